# Tool chain of the MKR1000's processor (SAM D21, Cortex-M0+).
set(CMAKE_SYSTEM_NAME Generic)
set(CMAKE_SYSTEM_PROCESSOR cortex-m0plus)
set(CMAKE_CXX_COMPILER arm-none-eabi-g++)
set(CMAKE_TRY_COMPILE_TARGET_TYPE STATIC_LIBRARY)
# As Arduino builds, and without the C++ library, which the core does not use: not even its sized delete, which the
# Arduino core does not bring either. Never -flto: with the SAMD core it
# links without a word and without the interrupt handlers.
set(CMAKE_CXX_FLAGS_INIT "-mcpu=cortex-m0plus -mthumb -nostdinc++ -fno-exceptions -fno-rtti \
-fno-threadsafe-statics -fno-sized-deallocation -ffunction-sections -fdata-sections")
