# The core as the board runs it: its size and stack, the sketch's types, and a run on an emulated Cortex-M0.
set(CMAKE_CXX_FLAGS_RELEASE "-Os")
# Newlib's small C library and GCC's own; no C++ library, which Debian packs by itself.
add_link_options(-nostartfiles -nodefaultlibs -Wl,--gc-sections)
link_libraries(c_nano gcc)
find_package(Python3 REQUIRED COMPONENTS Interpreter)

# -mcpu=cortex-m0plus; one object of each file, measured and run.
add_library(for_the_board OBJECT ${CORE} budget/core.cpp)
target_include_directories(for_the_board PUBLIC ${CORE_FOLDER})
target_compile_options(for_the_board PRIVATE -fstack-usage -fcallgraph-info=su)

# Everything that one wearable needs, linked as the image links it; the ports stay outside.
add_executable(core $<TARGET_OBJECTS:for_the_board>)
set_target_properties(core PROPERTIES LINKER_LANGUAGE CXX)
target_link_options(core PRIVATE -Wl,--entry=run_wearable)
add_custom_target(budget
  COMMAND ${Python3_EXECUTABLE} ${CMAKE_SOURCE_DIR}/budget/budget.py $<TARGET_FILE:core>
          ${CMAKE_BINARY_DIR}/CMakeFiles/for_the_board.dir
  DEPENDS core VERBATIM)

# The sketch's own code against the stubs, once for each board: nothing is linked.
file(GLOB GLUE CONFIGURE_DEPENDS wearable/src/arduino/*/*.cpp)
set(SKETCH ${CMAKE_BINARY_DIR}/sketch.cpp)
file(GENERATE OUTPUT ${SKETCH} CONTENT "#include <Arduino.h>\n#include \"wearable.ino\"\n")
add_custom_target(sketch)
function(add_sketch BOARD)
  add_library(sketch_${BOARD} OBJECT EXCLUDE_FROM_ALL ${SKETCH} ${GLUE})
  list(TRANSFORM ARGN PREPEND stubs/ OUTPUT_VARIABLE STUBS)
  target_include_directories(sketch_${BOARD} PRIVATE ${STUBS} wearable)
  target_compile_definitions(sketch_${BOARD} PRIVATE ARDUINO_${BOARD})
  add_dependencies(sketch sketch_${BOARD})
endfunction()
add_sketch(SAMD_MKR1000 samd wifi101)
add_sketch(SAMD_MKRWIFI1010 samd nina)
add_sketch(XIAO_ESP32S3 esp32)
add_sketch(NANO_ESP32 esp32)

# The same objects on an emulated Cortex-M0 (QEMU's micro:bit), which has the same instructions, with a small IMU and a
# small box around them.
set(GOLDEN ${CMAKE_SOURCE_DIR}/../tests/golden/wire.json)
add_custom_command(OUTPUT golden.h
  COMMAND ${Python3_EXECUTABLE} ${CMAKE_SOURCE_DIR}/qemu/golden_header.py ${GOLDEN} golden.h
  DEPENDS ${GOLDEN} qemu/golden_header.py VERBATIM)
file(GLOB RUNNER CONFIGURE_DEPENDS qemu/*.cpp)
add_executable(microbit ${RUNNER} ${CMAKE_BINARY_DIR}/golden.h)
target_include_directories(microbit PRIVATE ${CMAKE_BINARY_DIR})
target_link_libraries(microbit PRIVATE for_the_board)
target_link_options(microbit PRIVATE -T ${CMAKE_SOURCE_DIR}/qemu/microbit.ld)
# Time is virtual, 64 ns an instruction (shift=6): qemu/instructions.h counts by it.
add_custom_target(dance
  COMMAND timeout 120 qemu-system-arm -M microbit -nographic -monitor none -serial none -icount shift=6,sleep=off
          -semihosting-config enable=on,target=native -kernel $<TARGET_FILE:microbit>
  DEPENDS microbit VERBATIM)
