# What `cmake --install` puts where: GNUInstallDirs, DESTDIR and --prefix hold, and the tree may be moved afterwards.
include(GNUInstallDirs)
include(CMakePackageConfigHelpers)

set(package_dir ${CMAKE_INSTALL_LIBDIR}/cmake/stroll)
foreach(target stroll_shared stroll_static stroll_build_shared stroll_build_static)
  target_include_directories(${target} INTERFACE $<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}>)
endforeach()
set_target_properties(stroll PROPERTIES EXPORT_NAME program)
install(TARGETS stroll EXPORT stroll-program RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR} COMPONENT program)
install(TARGETS stroll_shared stroll_build_shared EXPORT stroll-shared
  LIBRARY DESTINATION ${CMAKE_INSTALL_LIBDIR} COMPONENT library NAMELINK_COMPONENT development)
install(TARGETS stroll_static stroll_build_static EXPORT stroll-static
  ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR} COMPONENT development)
install(DIRECTORY include/stroll DESTINATION ${CMAKE_INSTALL_INCLUDEDIR} COMPONENT development FILES_MATCHING PATTERN *.h)

add_custom_target(stroll_package DEPENDS stroll stroll_shared stroll_static stroll_build_shared stroll_build_static)

# ---- CMake: find_package(stroll)
strl_needs_of(needs base platform jobs geometry source container frame walk render readers store build)
set(STRL_PACKAGES "")
foreach(need ${needs})
  if(need MATCHES "^PkgConfig::(.*)$")
    string(APPEND STRL_PACKAGES "  pkg_check_modules(${CMAKE_MATCH_1} REQUIRED IMPORTED_TARGET ${${CMAKE_MATCH_1}_MODULE_NAME})\n")
  endif()
endforeach()
configure_package_config_file(tools/cmake/stroll-config.cmake.in ${CMAKE_BINARY_DIR}/package/stroll-config.cmake
  INSTALL_DESTINATION ${package_dir} NO_SET_AND_CHECK_MACRO)
write_basic_package_version_file(${CMAKE_BINARY_DIR}/package/stroll-config-version.cmake COMPATIBILITY SameMinorVersion)
install(FILES ${CMAKE_BINARY_DIR}/package/stroll-config.cmake ${CMAKE_BINARY_DIR}/package/stroll-config-version.cmake
  DESTINATION ${package_dir} COMPONENT development)
foreach(export stroll-shared stroll-static stroll-program)
  install(EXPORT ${export} NAMESPACE stroll:: DESTINATION ${package_dir} COMPONENT development)
endforeach()

# ---- pkg-config: stroll, stroll-build
set(pc_dir ${CMAKE_INSTALL_LIBDIR}/pkgconfig)
foreach(kind LIBDIR INCLUDEDIR)
  if(IS_ABSOLUTE ${CMAKE_INSTALL_${kind}})
    set(PC_${kind} ${CMAKE_INSTALL_${kind}})
  else()
    set(PC_${kind} "\${prefix}/${CMAKE_INSTALL_${kind}}")
  endif()
endforeach()
if(IS_ABSOLUTE ${CMAKE_INSTALL_LIBDIR})
  set(PC_PREFIX ${CMAKE_INSTALL_PREFIX})
else()
  file(RELATIVE_PATH up /${pc_dir} /)
  string(REGEX REPLACE "/$" "" up ${up})
  set(PC_PREFIX "\${pcfiledir}/${up}")
endif()

# strl_pkg_config(NAME LIBRARY DESCRIPTION REQUIRES MODULE...)
function(strl_pkg_config PC_NAME PC_LIBRARY PC_DESCRIPTION PC_REQUIRES)
  strl_needs_of(needs ${ARGN})
  set(packages "")
  set(libraries "")
  foreach(need ${needs})
    if(need STREQUAL "PkgConfig::curl")
      # By name: with --static libcurl.pc asks for the development files of all that libcurl itself is made of.
      list(TRANSFORM curl_LIBRARIES PREPEND -l OUTPUT_VARIABLE curl_links)
      list(APPEND libraries ${curl_links})
    elseif(need MATCHES "^PkgConfig::(.*)$")
      list(APPEND packages ${${CMAKE_MATCH_1}_MODULE_NAME})
    elseif(need STREQUAL "Threads::Threads")
      list(APPEND libraries -pthread)
    elseif(need MATCHES "^(\\$<BUILD_INTERFACE:.*INSTALL_INTERFACE:)?([A-Za-z0-9_+.-]+)>?$")
      list(APPEND libraries -l${CMAKE_MATCH_2})
    else()
      message(FATAL_ERROR "${PC_NAME}.pc cannot say what ${need} is")
    endif()
  endforeach()
  string(REPLACE ";" " " PC_PACKAGES "${packages}")
  string(REPLACE ";" " " PC_LIBRARIES "${libraries}")
  configure_file(tools/cmake/stroll.pc.in ${CMAKE_BINARY_DIR}/package/${PC_NAME}.pc @ONLY)
  install(FILES ${CMAKE_BINARY_DIR}/package/${PC_NAME}.pc DESTINATION ${pc_dir} COMPONENT development)
endfunction()
strl_pkg_config(stroll stroll "Walks through models of any size with a known pixel error" ""
  base platform jobs geometry source container frame walk render)
strl_pkg_config(stroll-build stroll_build "Builds the containers that Stroll walks through" "stroll = ${PROJECT_VERSION}"
  readers store build)

# ---- manual pages and completion, written from what --help says
find_package(Python3 COMPONENTS Interpreter)
if(Python3_FOUND)
  set(manual ${CMAKE_BINARY_DIR}/manual)
  file(GLOB manual_texts CONFIGURE_DEPENDS docs/man/*.in)
  add_custom_command(OUTPUT ${manual}/stamp VERBATIM
    DEPENDS stroll tools/manual.py ${manual_texts}
    COMMAND ${Python3_EXECUTABLE} ${CMAKE_SOURCE_DIR}/tools/manual.py --program $<TARGET_FILE:stroll> --out ${manual}
    COMMAND ${CMAKE_COMMAND} -E touch ${manual}/stamp)
  add_custom_target(manual ALL DEPENDS ${manual}/stamp)
  add_dependencies(stroll_package manual)
  install(DIRECTORY ${manual}/man/ DESTINATION ${CMAKE_INSTALL_MANDIR}/man1 COMPONENT program)
  install(FILES ${manual}/completion/stroll.bash DESTINATION ${CMAKE_INSTALL_DATADIR}/bash-completion/completions
    RENAME stroll COMPONENT program)
  install(FILES ${manual}/completion/_stroll DESTINATION ${CMAKE_INSTALL_DATADIR}/zsh/site-functions COMPONENT program)
  install(FILES ${manual}/completion/stroll.fish DESTINATION ${CMAKE_INSTALL_DATADIR}/fish/vendor_completions.d
    COMPONENT program)
else()
  message(STATUS "manual pages and completion are left out: no python3")
endif()

install(FILES README.md CHANGELOG.md LICENSE DESTINATION ${CMAKE_INSTALL_DOCDIR} COMPONENT documentation)
install(DIRECTORY docs DESTINATION ${CMAKE_INSTALL_DOCDIR} COMPONENT documentation
  FILES_MATCHING REGEX "\\.(md|png|svg)$" REGEX "/guide/.*\\.[ch]$" PATTERN man EXCLUDE)
