# Shaders become a C file of strl_render at build time.
file(GLOB shaders CONFIGURE_DEPENDS ${CMAKE_SOURCE_DIR}/shaders/*.glsl)
set(embedded ${CMAKE_BINARY_DIR}/generated/shaders.c)
set(embed_script ${CMAKE_SOURCE_DIR}/tools/cmake/EmbedText.cmake)
add_custom_command(OUTPUT ${embedded} DEPENDS ${shaders} ${embed_script} VERBATIM
  COMMAND ${CMAKE_COMMAND} -DOUTPUT=${embedded} "-DINPUTS=${shaders}" -P ${embed_script})
if(TARGET strl_render)
  get_target_property(render_type strl_render TYPE)
  if(NOT render_type STREQUAL "INTERFACE_LIBRARY")
    target_sources(strl_render PRIVATE ${embedded})
  endif()
endif()
