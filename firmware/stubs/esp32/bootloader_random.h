// ESP-IDF 5.5's noise for the random generator while no radio runs. Only signatures.
#pragma once

extern "C" {
void bootloader_random_enable();
void bootloader_random_disable();
}
