# One libFuzzer target for each source in fuzz/; needs clang.
file(GLOB TARGETS CONFIGURE_DEPENDS fuzz/*.cpp)
set(SANITIZERS -fsanitize=fuzzer,address,undefined -fno-sanitize-recover=all)
add_compile_options(-O1 -g ${SANITIZERS})
add_link_options(${SANITIZERS})

add_library(fuzzed_core OBJECT ${CORE})
set_target_properties(fuzzed_core PROPERTIES UNITY_BUILD ON UNITY_BUILD_MODE GROUP)
target_include_directories(fuzzed_core PUBLIC ${CORE_FOLDER})
foreach(SOURCE ${TARGETS})
  get_filename_component(NAME ${SOURCE} NAME_WE)
  add_executable(${NAME} ${SOURCE})
  target_link_libraries(${NAME} PRIVATE fuzzed_core)
endforeach()
