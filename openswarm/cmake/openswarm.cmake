# SPDX-License-Identifier: MIT
# CMake's toolchain file for the dsPIC30F6014A:  cmake --toolchain "$(openswarm path cmake)/openswarm.cmake" ...
# and openswarm_application(), which needs no toolchain file.
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
include(${CMAKE_CURRENT_LIST_DIR}/openswarm_application.cmake)
