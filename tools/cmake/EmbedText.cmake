# cmake -DOUTPUT=FILE.c -DINPUTS="a.glsl;b.glsl" -P EmbedText.cmake: one zero-terminated array a file,
# strl__shader_NAME with every character of NAME that is not of C replaced by _.
set(text "/* Generated from shaders/. */\n#include \"render/glcommon/shaders.h\"\n")
foreach(input ${INPUTS})
  get_filename_component(name ${input} NAME)
  string(REGEX REPLACE "\\.glsl$" "" name ${name})
  string(MAKE_C_IDENTIFIER ${name} name)
  file(READ ${input} hex HEX)
  string(REGEX REPLACE "(................................)" "\\1\n" hex "${hex}")
  string(REGEX REPLACE "([0-9a-f][0-9a-f])" "0x\\1," hex "${hex}")
  string(APPEND text "const char strl__shader_${name}[] = {\n${hex}0};\n")
endforeach()
file(WRITE ${OUTPUT} "${text}")
