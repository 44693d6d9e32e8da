# libstroll is what walks and draws; libstroll_build is what builds, with what reads and partitions meshes behind it. Both are
# shared and static, of the modules' objects. A program that walks thus needs none of the builder's libraries.
if(STRL_FUZZ)
  return() # libFuzzer's runtime is the fuzzer's
endif()

# What the modules link of other projects; libraries that were found by path go by their names where they are installed.
function(strl_needs_of out)
  set(needs "")
  foreach(module ${ARGN})
    get_property(links GLOBAL PROPERTY STRL_LINK_${module})
    foreach(link ${links})
      if(IS_ABSOLUTE ${link})
        get_filename_component(name ${link} NAME_WE)
        string(REGEX REPLACE "^lib" "" name ${name})
        set(link "$<BUILD_INTERFACE:${link}>$<INSTALL_INTERFACE:${name}>")
      endif()
      list(APPEND needs ${link})
    endforeach()
  endforeach()
  list(REMOVE_DUPLICATES needs)
  set(${out} "${needs}" PARENT_SCOPE)
endfunction()

# strl_library(NAME EXPORTED): EXPORTED of CMake's package is the shared library NAME, EXPORTED_static the archive.
function(strl_library name exported)
  set(objects "")
  foreach(module ${ARGN})
    list(APPEND objects $<TARGET_OBJECTS:strl_${module}>)
  endforeach()
  strl_needs_of(needs ${ARGN})
  add_library(${name}_shared SHARED ${objects})
  add_library(${name}_static STATIC ${objects})
  set_target_properties(${name}_shared PROPERTIES EXPORT_NAME ${exported} VERSION ${PROJECT_VERSION}
    SOVERSION ${PROJECT_VERSION_MAJOR}.${PROJECT_VERSION_MINOR})
  set_target_properties(${name}_static PROPERTIES EXPORT_NAME ${exported}_static)
  foreach(target ${name}_shared ${name}_static)
    set_target_properties(${target} PROPERTIES OUTPUT_NAME ${name} LINKER_LANGUAGE C)
    target_include_directories(${target} INTERFACE $<BUILD_INTERFACE:${CMAKE_SOURCE_DIR}/include>)
    target_link_libraries(${target} PRIVATE ${needs})
  endforeach()
  target_link_libraries(${name}_shared PRIVATE $<BUILD_INTERFACE:strl_sanitize>)
  if(NOT STRL_SANITIZE)
    target_link_options(${name}_shared PRIVATE -Wl,--no-undefined)
  endif()
endfunction()

strl_library(stroll stroll base platform jobs geometry source container frame walk render)
strl_library(stroll_build build readers store build)
# What both are made of is a copy of its own in libstroll_build.so, of which nothing is visible.
target_link_libraries(stroll_build_shared PRIVATE $<BUILD_INTERFACE:strl_container> $<BUILD_INTERFACE:strl_jobs>
  INTERFACE stroll_shared)
target_link_options(stroll_build_shared PRIVATE -Wl,--exclude-libs,ALL)
target_link_libraries(stroll_build_static PUBLIC stroll_static)
