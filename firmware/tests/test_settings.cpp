// Settings that survive power-off, also after a power cut or a changed layout.
#include <doctest/doctest.h>

#include <cstring>
#include <set>

#include "blake2s.h"
#include "boot_nonce.h"
#include "fakes.h"
#include "settings.h"

using namespace bunraku;

namespace {

Settings full() {
  Settings settings;
  strcpy(settings.name, "a-name-of-24-characters!");
  settings.device_id = 0x1A2B3C4D;
  settings.has_key = true;
  for (uint8_t i = 0; i < sizeof settings.key; ++i) settings.key[i] = static_cast<uint8_t>(200 + i);
  memset(settings.network, 'n', kLongestNetwork);
  memset(settings.password, 'p', kLongestPassword);
  settings.port = 65535;
  settings.imu = {Fusion::kNdof, 0x21, 0x04, true};
  return settings;
}

constexpr uint8_t kImuId[kImuIdBytes] = {1, 2, 3};
constexpr uint8_t kOtherImuId[kImuIdBytes] = {1, 2, 4};
constexpr uint8_t kZeroKey[wire::kKeyBytes] = {};

}  // namespace

TEST_CASE("settings come back as they were saved, at their longest") {
  fakes::FakeFlash flash;
  REQUIRE(strlen(full().name) == kLongestName);
  REQUIRE(save_settings(flash, full()));
  Settings settings;
  REQUIRE(load_settings(flash, settings));
  const Settings saved = full();
  CHECK(strcmp(settings.name, saved.name) == 0);
  CHECK(settings.device_id == saved.device_id);
  CHECK(settings.has_key);
  CHECK(memcmp(settings.key, saved.key, sizeof saved.key) == 0);
  CHECK(strcmp(settings.network, saved.network) == 0);
  CHECK(strcmp(settings.password, saved.password) == 0);
  CHECK(settings.port == 65535);
  CHECK(settings.imu.fusion == Fusion::kNdof);
  CHECK(settings.imu.axis_map == 0x21);
  CHECK(settings.imu.axis_sign == 0x04);
  CHECK(settings.imu.has_crystal);
  CHECK(settings.is_provisioned());
}

TEST_CASE("a record from before there was a crystal to set is read as it was") {
  fakes::FakeFlash with, without;
  Settings settings = full();
  save_settings(with, settings);
  settings.imu.has_crystal = false;
  save_settings(without, settings);
  CHECK(with.records.begin()->second.size() == without.records.begin()->second.size());
  REQUIRE(load_settings(without, settings));
  CHECK_FALSE(settings.imu.has_crystal);
  CHECK(settings.imu.fusion == Fusion::kNdof);
}

TEST_CASE("a fresh board has the defaults and no owner") {
  fakes::FakeFlash flash;
  Settings settings = full();
  CHECK_FALSE(load_settings(flash, settings));
  CHECK_FALSE(settings.is_provisioned());
  CHECK(settings.port == 9750);
  CHECK(settings.network[0] == '\0');
  CHECK(settings.imu.fusion == Fusion::kImuPlus);
  CHECK(settings.imu.axis_map == 0x24);
}

TEST_CASE("a record with any byte wrong counts as never written") {
  fakes::FakeFlash flash;
  save_settings(flash, full());
  const fakes::Bytes record = flash.records.begin()->second;
  CHECK(record.size() <= 192);
  for (size_t at = 0; at < record.size(); ++at) {
    flash.records.begin()->second = record;
    flash.records.begin()->second[at] ^= 0x10;
    Settings settings = full();
    CHECK_FALSE(load_settings(flash, settings));
    CHECK_FALSE(settings.is_provisioned());
  }
}

TEST_CASE("a profile belongs to one BNO055") {
  fakes::FakeFlash flash;
  uint8_t offsets[kProfileBytes] = {9, 8, 7}, loaded[kProfileBytes] = {};
  CHECK_FALSE(load_profile(flash, kImuId, loaded));
  REQUIRE(save_profile(flash, kImuId, offsets));
  REQUIRE(load_profile(flash, kImuId, loaded));
  CHECK(memcmp(offsets, loaded, sizeof offsets) == 0);
  CHECK_FALSE(load_profile(flash, kOtherImuId, loaded));
}

TEST_CASE("what is forgotten is nowhere in the flash; power-ons stay counted") {
  fakes::FakeFlash flash;
  uint8_t offsets[kProfileBytes] = {9, 8, 7};
  save_settings(flash, full());
  save_profile(flash, kImuId, offsets);
  count_boot(flash);
  REQUIRE(forget_all(flash));
  Settings settings;
  CHECK_FALSE(load_settings(flash, settings));
  CHECK_FALSE(load_profile(flash, kImuId, offsets));
  for (const auto& record : flash.records)
    for (size_t at = 0; at + 2 < record.second.size(); ++at)
      CHECK_FALSE((record.second[at] == 200 && record.second[at + 1] == 201));
  CHECK(count_boot(flash) == 2);
}

TEST_CASE("a flash that fails is told") {
  fakes::FakeFlash flash;
  flash.is_broken = true;
  CHECK_FALSE(save_settings(flash, full()));
  CHECK_FALSE(forget_all(flash));
}

TEST_CASE("power-ons are counted, and a power cut while counting loses at most that one") {
  fakes::FakeFlash flash;
  for (uint32_t boot = 1; boot <= 20; ++boot) CHECK(count_boot(flash) == boot);
  const auto before = flash.records;
  count_boot(flash);  // 21, and the power goes
  for (auto& record : flash.records)
    if (record.second != before.at(record.first)) record.second.assign(record.second.size(), 0xFF);
  CHECK(count_boot(flash) == 21);
  CHECK(count_boot(flash) == 22);
}

TEST_CASE("power-ons are counted on when one of the two records is worn out") {
  for (const int slot : {2, 3}) {
    fakes::FakeFlash flash;
    for (uint32_t boot = 1; boot <= 5; ++boot) CHECK(count_boot(flash) == boot);
    flash.worn_out_slot = slot;
    for (uint32_t boot = 6; boot <= 20; ++boot) CHECK(count_boot(flash) == boot);
  }
}

TEST_CASE("boot nonces do not repeat while either the count or the noise works") {
  for (const bool is_noisy : {true, false}) {
    std::set<uint32_t> drawn;
    fakes::FakeFlash flash;
    fakes::FakeBoard board;
    board.is_noisy = is_noisy;
    flash.is_broken = is_noisy;
    for (int i = 0; i < 1000; ++i) drawn.insert(draw_boot_nonce(kZeroKey, flash, board));
    CHECK(drawn.size() == 1000);
    CHECK(drawn.count(0) == 0);
  }
}

TEST_CASE("boards with other keys draw other nonces") {
  fakes::FakeFlash flash, other_flash;
  fakes::FakeBoard board, other_board;
  const uint8_t key[wire::kKeyBytes] = {1};
  CHECK(draw_boot_nonce(kZeroKey, flash, board) != draw_boot_nonce(key, other_flash, other_board));
}
