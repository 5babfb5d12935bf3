# SPDX-License-Identifier: MIT
# CMake's toolchain file for the dsPIC30F6014A:  cmake --toolchain "$(openswarm path cmake)/openswarm.cmake" ...
#
# openswarm_application(NAME SOURCES FILE... [DEVICES NAME...] [DEFINES NAME=VALUE...])
#   builds NAME.elf and NAME.hex from the files, the kernel and its devices; DEVICES are the drivers beside the standard
#   ones, folders of openswarm/io and openswarm/board/epuck of the kernel. Objects hold LLVM IR (-flto), so that the whole
#   program is optimised when it is linked, as the kernel's Makefile does.
set(CMAKE_SYSTEM_NAME Generic)
set(CMAKE_SYSTEM_PROCESSOR dspic30f6014a)

find_program(CMAKE_C_COMPILER dspic-cc REQUIRED)
find_program(CMAKE_AR dspic-ar REQUIRED)
find_program(CMAKE_RANLIB dspic-ranlib REQUIRED)
find_program(CMAKE_LINKER dspic-ld REQUIRED)
find_program(CMAKE_NM dspic-nm REQUIRED)
find_program(CMAKE_OBJDUMP dspic-objdump REQUIRED)
find_program(OPENSWARM_HEX dspic-hex REQUIRED)
find_program(OPENSWARM_COMMAND openswarm REQUIRED)
set(CMAKE_ASM_COMPILER ${CMAKE_C_COMPILER})
set(CMAKE_ASM_COMPILER_ID_RUN TRUE)  # skips CMake's identification, which does not know this assembler
set(CMAKE_ASM_COMPILER_ID Clang)

# CMake's trials only compile, because they could not link without main
set(CMAKE_TRY_COMPILE_TARGET_TYPE STATIC_LIBRARY)
set(CMAKE_EXECUTABLE_SUFFIX_C .elf)
set(CMAKE_EXECUTABLE_SUFFIX_ASM .elf)
set(CMAKE_EXPORT_COMPILE_COMMANDS ON)
set(CMAKE_C_FLAGS_INIT "-fstack-check")
set(CMAKE_C_FLAGS_DEBUG_INIT "-Os -g")
set(CMAKE_C_FLAGS_RELEASE_INIT "-Os -g")
set(CMAKE_C_FLAGS_MINSIZEREL_INIT "-Os")
set(CMAKE_C_FLAGS_RELWITHDEBINFO_INIT "-O2 -g")
if(NOT CMAKE_BUILD_TYPE)
  set(CMAKE_BUILD_TYPE Release CACHE STRING "-Os -g, as the kernel's Makefile builds")
endif()
set(CMAKE_FIND_ROOT_PATH_MODE_PROGRAM NEVER)
set(CMAKE_FIND_ROOT_PATH_MODE_LIBRARY ONLY)
set(CMAKE_FIND_ROOT_PATH_MODE_INCLUDE ONLY)

function(openswarm_application name)
  cmake_parse_arguments(PARSE_ARGV 1 APP "" "" "SOURCES;DEVICES;DEFINES")
  if(NOT APP_SOURCES OR APP_UNPARSED_ARGUMENTS)
    message(FATAL_ERROR "openswarm_application(NAME SOURCES FILE... [DEVICES NAME...] [DEFINES NAME=VALUE...])")
  endif()
  execute_process(COMMAND ${OPENSWARM_COMMAND} path firmware OUTPUT_VARIABLE firmware OUTPUT_STRIP_TRAILING_WHITESPACE
                  COMMAND_ERROR_IS_FATAL ANY)
  set(os ${firmware}/openswarm)
  set(folders ${os}/kernel ${os}/io ${os}/board/epuck ${os}/port/dspic30f)
  set(devices)
  foreach(device IN LISTS APP_DEVICES)
    set(found)
    foreach(place io board/epuck)
      if(IS_DIRECTORY ${os}/${place}/${device})
        list(APPEND found ${os}/${place}/${device})
      endif()
    endforeach()
    if(NOT found)
      message(FATAL_ERROR "DEVICES ${device}: neither in ${os}/io nor in ${os}/board/epuck")
    endif()
    list(APPEND devices ${found})
  endforeach()
  set(system)
  foreach(folder IN LISTS folders devices)
    file(GLOB files CONFIGURE_DEPENDS ${folder}/*.c ${folder}/*.S)
    list(APPEND system ${files})
  endforeach()
  add_executable(${name} ${APP_SOURCES} ${system})
  target_include_directories(${name} PRIVATE ${os}/include ${os}/hal ${os}/kernel ${os}/io ${os}/port/dspic30f
                             ${os}/board/epuck ${devices})
  target_compile_definitions(${name} PRIVATE ${APP_DEFINES})
  get_filename_component(beside ${firmware} DIRECTORY)
  target_compile_options(${name} PRIVATE -Wall -Wextra -ffile-prefix-map=${PROJECT_SOURCE_DIR}/=
                         -ffile-prefix-map=${beside}/= $<$<COMPILE_LANGUAGE:C>:-flto>)
  target_link_options(${name} PRIVATE -Os -fstack-check)
  add_custom_command(TARGET ${name} POST_BUILD COMMAND ${OPENSWARM_HEX} $<TARGET_FILE:${name}> -o ${name}.hex
                     BYPRODUCTS ${name}.hex VERBATIM)
endfunction()
