# SPDX-License-Identifier: MIT
# openswarm_application(NAME FOLDER DIRECTORY | SOURCES FILE... [DEVICES NAME...] [DEFINES NAME=VALUE...])
#   builds NAME.elf and NAME.hex in the binary folder, from an application's folder (with its app.mk and sub-folders) or from
#   its files, the kernel and its devices. DEVICES are the drivers beside the standard ones, folders of openswarm/io and
#   openswarm/board/epuck of the kernel. The kernel's Makefile builds, so that the image is the same as with make, to the byte;
#   compile_commands.json is written beside it.
function(openswarm_application name)
  cmake_parse_arguments(PARSE_ARGV 1 APP "" "FOLDER" "SOURCES;DEVICES;DEFINES")
  if((NOT APP_SOURCES AND NOT APP_FOLDER) OR APP_UNPARSED_ARGUMENTS)
    message(FATAL_ERROR "openswarm_application(NAME FOLDER DIRECTORY | SOURCES FILE... [DEVICES NAME...] [DEFINES NAME=VALUE...])")
  endif()
  find_program(OPENSWARM_COMMAND openswarm REQUIRED)
  find_program(OPENSWARM_MAKE NAMES gmake make REQUIRED)
  foreach(what firmware python)
    execute_process(COMMAND ${OPENSWARM_COMMAND} path ${what} OUTPUT_VARIABLE ${what} OUTPUT_STRIP_TRAILING_WHITESPACE
                    COMMAND_ERROR_IS_FATAL ANY)
  endforeach()
  foreach(device IN LISTS APP_DEVICES)
    if(NOT IS_DIRECTORY ${firmware}/openswarm/io/${device} AND NOT IS_DIRECTORY ${firmware}/openswarm/board/epuck/${device})
      message(FATAL_ERROR "DEVICES ${device}: neither in ${firmware}/openswarm/io nor in ${firmware}/openswarm/board/epuck")
    endif()
  endforeach()
  get_filename_component(beside ${firmware} DIRECTORY)
  set(out ${CMAKE_CURRENT_BINARY_DIR}/${name}.make)
  set(words "OUT=${out}" "PYTHON=${python}" "WARNINGS=-Wall -Wextra"
      "RECORDED=-ffile-prefix-map=${beside}/= -ffile-prefix-map=${PROJECT_SOURCE_DIR}/=")
  if(APP_FOLDER)
    get_filename_component(folder ${APP_FOLDER} ABSOLUTE BASE_DIR ${CMAKE_CURRENT_SOURCE_DIR})
    get_filename_component(apps ${folder} DIRECTORY)
    get_filename_component(app ${folder} NAME)
    list(APPEND words "APPS=${apps}" "APP=${app}")
  else()
    set(files)
    foreach(source IN LISTS APP_SOURCES)
      get_filename_component(source ${source} ABSOLUTE BASE_DIR ${CMAKE_CURRENT_SOURCE_DIR})
      list(APPEND files ${source})
    endforeach()
    list(JOIN files " " files)
    list(APPEND words "APPS=${CMAKE_CURRENT_SOURCE_DIR}" "APP=." "APP_FILES=${files}")
  endif()
  if(APP_DEVICES)
    list(JOIN APP_DEVICES " " devices)
    list(APPEND words "DEVICES=${devices}")
  endif()
  if(APP_DEFINES)
    list(TRANSFORM APP_DEFINES PREPEND "-D")
    list(JOIN APP_DEFINES " " defines)
    list(APPEND words "DEFINES=${defines}")
  endif()
  add_custom_target(${name} ALL
    COMMAND ${OPENSWARM_MAKE} -s --no-print-directory -C ${firmware} ${words}
    COMMAND ${CMAKE_COMMAND} -E copy_if_different ${out}/firmware.elf ${CMAKE_CURRENT_BINARY_DIR}/${name}.elf
    COMMAND ${CMAKE_COMMAND} -E copy_if_different ${out}/compile_commands.json ${CMAKE_BINARY_DIR}/compile_commands.json
    COMMAND ${python} -m toolchain hex ${name}.elf -o ${name}.hex
    BYPRODUCTS ${name}.elf ${name}.hex
    WORKING_DIRECTORY ${CMAKE_CURRENT_BINARY_DIR} VERBATIM)
endfunction()
