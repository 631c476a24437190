# The core as the board runs it: its size and stack, the sketch's types, and a run on an emulated Cortex-M0.
set(CMAKE_CXX_FLAGS_RELEASE "-Os")
# Newlib's small C library and GCC's own; no C++ library, which Debian packs by itself.
add_link_options(-nostartfiles -nodefaultlibs -Wl,--gc-sections)
link_libraries(c_nano gcc)
find_package(Python3 REQUIRED COMPONENTS Interpreter)

# Everything that one wearable needs, linked as the image links it; the ports stay outside.
add_executable(core ${CORE} budget/core.cpp)
target_include_directories(core PRIVATE ${CORE_FOLDER})
target_compile_options(core PRIVATE -fstack-usage -fcallgraph-info=su)
target_link_options(core PRIVATE -Wl,--entry=run_wearable)
add_custom_target(budget
  COMMAND ${Python3_EXECUTABLE} ${CMAKE_SOURCE_DIR}/budget/budget.py $<TARGET_FILE:core>
          ${CMAKE_BINARY_DIR}/CMakeFiles/core.dir
  DEPENDS core VERBATIM)

# The sketch's own code against the stubs: nothing is linked.
file(GLOB GLUE CONFIGURE_DEPENDS wearable/src/arduino/*.cpp)
set(SKETCH ${CMAKE_BINARY_DIR}/sketch.cpp)
file(GENERATE OUTPUT ${SKETCH} CONTENT "#include <Arduino.h>\n#include \"wearable.ino\"\n")
add_library(sketch OBJECT ${SKETCH} ${GLUE})
target_include_directories(sketch PRIVATE stubs wearable)

# The core on an emulated Cortex-M0 (QEMU's micro:bit), with a small IMU and a small box around it.
set(GOLDEN ${CMAKE_SOURCE_DIR}/../tests/golden/wire.json)
add_custom_command(OUTPUT golden.h
  COMMAND ${Python3_EXECUTABLE} ${CMAKE_SOURCE_DIR}/qemu/golden_header.py ${GOLDEN} golden.h
  DEPENDS ${GOLDEN} qemu/golden_header.py VERBATIM)
file(GLOB RUNNER CONFIGURE_DEPENDS qemu/*.cpp)
add_executable(microbit ${CORE} ${RUNNER} ${CMAKE_BINARY_DIR}/golden.h)
target_include_directories(microbit PRIVATE ${CORE_FOLDER} ${CMAKE_BINARY_DIR})
target_compile_options(microbit PRIVATE -mcpu=cortex-m0)
target_link_options(microbit PRIVATE -T ${CMAKE_SOURCE_DIR}/qemu/microbit.ld)
# Time is virtual, 64 ns an instruction (shift=6): qemu/instructions.h counts by it.
add_custom_target(dance
  COMMAND timeout 120 qemu-system-arm -M microbit -nographic -monitor none -serial none -icount shift=6,sleep=off
          -semihosting-config enable=on,target=native -kernel $<TARGET_FILE:microbit>
  DEPENDS microbit VERBATIM)
