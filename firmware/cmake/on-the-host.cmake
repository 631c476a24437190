# libwearable.so, and the tests with sanitizers (target core_tests, built when asked for).
file(GLOB HOST CONFIGURE_DEPENDS host/*.cpp)
file(GLOB TESTS CONFIGURE_DEPENDS tests/*.cpp)

add_library(wearable SHARED ${CORE} ${HOST})
target_include_directories(wearable PRIVATE ${CORE_FOLDER} host)

add_executable(core_tests EXCLUDE_FROM_ALL ${CORE} ${HOST} ${TESTS} wearable/src/arduino/page_log.cpp)
target_include_directories(core_tests PRIVATE ${CORE_FOLDER} wearable/src/arduino host)
target_compile_definitions(core_tests PRIVATE BUNRAKU_GOLDEN_DIR="${CMAKE_SOURCE_DIR}/../tests/golden")
set(SANITIZERS -fsanitize=address,undefined -fno-sanitize-recover=all)
target_compile_options(core_tests PRIVATE -O1 -g -fno-omit-frame-pointer ${SANITIZERS})
target_link_options(core_tests PRIVATE ${SANITIZERS})
