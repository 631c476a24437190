# libwearable.so, and the tests with sanitizers (target core_tests, built when asked for). Several files at once: most
# of a file's time goes into the standard library's headers and templates. Core and host stay apart, as on the board.
set(CMAKE_UNITY_BUILD ON)
set(CMAKE_UNITY_BUILD_BATCH_SIZE 13)
file(GLOB HOST CONFIGURE_DEPENDS host/*.cpp)
file(GLOB TESTS CONFIGURE_DEPENDS tests/test_*.cpp)
set_source_files_properties(${HOST} PROPERTIES UNITY_GROUP host)
foreach(SOURCE ${HOST})
  if(SOURCE MATCHES "/(bno055|bno085|lsm6dsv)_")
    set_source_files_properties(${SOURCE} PROPERTIES UNITY_GROUP host_${CMAKE_MATCH_1})
  endif()
endforeach()

add_library(wearable SHARED ${CORE} ${HOST})
target_include_directories(wearable PRIVATE ${CORE_FOLDER} host)

set(SANITIZERS -fsanitize=address,undefined -fno-sanitize-recover=all)
add_library(sanitized OBJECT EXCLUDE_FROM_ALL ${CORE} ${HOST} wearable/src/arduino/samd/page_log.cpp)
target_include_directories(sanitized PUBLIC ${CORE_FOLDER} wearable/src/arduino/samd host)
target_compile_options(sanitized PUBLIC -g1 -fno-omit-frame-pointer ${SANITIZERS} PRIVATE -O1)
target_link_options(sanitized PUBLIC ${SANITIZERS})
set_target_properties(wearable sanitized PROPERTIES UNITY_BUILD_MODE GROUP)

add_library(doctest OBJECT EXCLUDE_FROM_ALL tests/main.cpp)
target_compile_options(doctest PRIVATE -O0)

# doctest, which has no sanitizers, last: of a template that several objects bring, the linker takes the first.
add_executable(core_tests EXCLUDE_FROM_ALL ${TESTS})
target_compile_definitions(core_tests PRIVATE BUNRAKU_GOLDEN_DIR="${CMAKE_SOURCE_DIR}/../tests/golden")
target_compile_options(core_tests PRIVATE -O0)
target_link_libraries(core_tests PRIVATE sanitized doctest)
