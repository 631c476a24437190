// The console: every command, every refusal, and no secret in any answer.
#include <doctest/doctest.h>

#include <cstdio>
#include <cstring>
#include <string>
#include <vector>

#include "blake2s.h"
#include "console.h"
#include "line_parsing.h"
#include "version.h"
#include "wire.h"

using namespace bunraku;

namespace {

constexpr char kKeyAsHex[] = "000102030405060708090a0b0c0d0e0f";

struct Session {
  Console console;
  Status status;
  Request request = Request::kNothing;

  std::string ask(const std::string& line) {
    Answer answer;
    request = console.execute(line.c_str(), status, 0xB0A2D001, answer);
    CHECK(strlen(answer.text()) == answer.count());
    return answer.text();
  }
  void provision() {
    for (const char* line :
         {"set name left-wrist", "set device 1a2b3c4d", "set network Stage Left", "set port 9751",
          "set password break a leg", "set fusion ndof", "set crystal yes", "set axes 21 04"})
      CHECK(ask(line) == "ok");
    CHECK(ask(std::string("set key ") + kKeyAsHex) == "ok");
  }
};

bool is_error(const std::string& answer) { return answer.substr(0, 7) == "error: "; }

}  // namespace

TEST_CASE("id") {
  Session session;
  char wire_hash[9];
  snprintf(wire_hash, sizeof wire_hash, "%08x", wire::kWireHash);
  const std::string who = std::string("ok bunraku-wearable ") + kFirmwareVersion + " wire " + wire_hash;
  CHECK(session.ask("id") == who + " imu none board b0a2d001");
  session.status.has_imu_id = true;
  for (uint8_t i = 0; i < 16; ++i) session.status.imu_id[i] = static_cast<uint8_t>(0x50 + i);
  CHECK(session.ask("id") == who + " imu 505152535455565758595a5b5c5d5e5f board b0a2d001");
}

TEST_CASE("a fresh board shows that it knows nothing") {
  Session session;
  CHECK(session.ask("show") ==
        "ok name none device none key none password none port 9750 fusion imuplus crystal no axes 24 00 network ");
}

TEST_CASE("what was set is shown and kept in the draft; secrets only as set") {
  Session session;
  session.provision();
  CHECK(session.ask("show") ==
        "ok name left-wrist device 1a2b3c4d key set password set port 9751 fusion ndof crystal yes axes 21 04 "
        "network Stage Left");
  const Settings& draft = session.console.draft();
  CHECK(draft.device_id == 0x1A2B3C4D);
  CHECK(draft.key[15] == 15);
  CHECK(std::string(draft.password) == "break a leg");
  CHECK(draft.imu.fusion == Fusion::kNdof);
  CHECK(draft.imu.has_crystal);
  CHECK(draft.is_provisioned());
}

TEST_CASE("a network and a password can be taken away") {
  Session session;
  session.provision();
  CHECK(session.ask("set network ") == "ok");
  CHECK(session.ask("set password") == "ok");
  CHECK(session.console.draft().network[0] == '\0');
  CHECK(session.console.draft().password[0] == '\0');
}

TEST_CASE("names of networks may have letters beyond ASCII and spaces at their ends") {
  Session session;
  CHECK(session.ask("set network  B\xC3\xBChne ") == "ok");
  CHECK(std::string(session.console.draft().network) == " B\xC3\xBChne ");
}

TEST_CASE("what breaks a rule changes nothing") {
  for (const char* line : {"set device 1a2b3c4",
                           "set device 1a2b3c4dd",
                           "set device 1a2b3c4g",
                           "set device 00000000",
                           "set device",
                           "set device -1a2b3c4",
                           "set key 00",
                           "set key 000102030405060708090a0b0c0d0e0",
                           "set key",
                           "set key 000102030405060708090a0b0c0d0e0f00",
                           "set key 0001020304050607 8090a0b0c0d0e0f",
                           "set name",
                           "set name two words",
                           "set name a-name-of-25-characters!!",
                           "set name B\xC3\xBChne",
                           "set port 0",
                           "set port 65536",
                           "set port 4294977046",
                           "set port 9750x",
                           "set port -1",
                           "set port",
                           "set password short",
                           "set password 1234567890123456789012345678901234567890123456789012345678901234",
                           "set network 123456789012345678901234567890123",
                           "set fusion amg",
                           "set fusion",
                           "set crystal",
                           "set crystal 1",
                           "set crystal maybe",
                           "set crystal yes ",
                           "set axes 24",
                           "set axes 24 08",
                           "set axes 64 00",
                           "set axes 25 00",
                           "set axes 24 01",
                           "set axes 2400",
                           "set axes 24 00 "}) {
    CAPTURE(line);
    Session session;
    const std::string before = session.ask("show");
    CHECK(is_error(session.ask(line)));
    CHECK(session.ask("show") == before);
  }
}

TEST_CASE("the longest values fit") {
  Session session;
  CHECK(session.ask("set name " + std::string(24, 'n')) == "ok");
  CHECK(session.ask("set network " + std::string(32, 'w')) == "ok");
  CHECK(session.ask("set password " + std::string(63, 'p')) == "ok");
  CHECK(session.ask("set port 65535") == "ok");
  CHECK(session.console.draft().port == 65535);
  CHECK(session.ask("show").find(std::string(32, 'w')) != std::string::npos);
}

TEST_CASE("prove: keyed BLAKE2s over the word and the nonce") {
  Session session;
  CHECK(is_error(session.ask("prove 0011223344556677")));
  session.provision();
  uint8_t key[16], proof[8];
  for (uint8_t i = 0; i < 16; ++i) key[i] = i;
  const uint8_t message[] = {'p', 'r', 'o', 'v', 'e', 0x00, 0x11, 0x22, 0x33, 0x44, 0x55, 0x66, 0x77};
  blake2s({key, sizeof key, message, sizeof message}, proof, sizeof proof);
  Answer expected;
  expected.add("ok ").add_hex(proof, sizeof proof);
  CHECK(session.ask("prove 0011223344556677") == expected.text());
  CHECK(session.ask("prove 0011223344556678") != expected.text());
  CHECK(is_error(session.ask("prove 00112233445566")));
  CHECK(is_error(session.ask("prove")));
}

TEST_CASE("what the wearable has to do is asked of it") {
  Session session;
  const std::vector<std::pair<const char*, Request>> requests = {{"save", Request::kSave},
                                                                 {"forget", Request::kForget},
                                                                 {"strobe", Request::kStrobe},
                                                                 {"calibration save", Request::kSaveCalibration},
                                                                 {"restart", Request::kRestart}};
  for (const auto& known : requests) {
    CHECK(session.ask(known.first).substr(0, 2) == "ok");
    CHECK(session.request == known.second);
  }
  CHECK(session.ask("save") == "ok saved");
  session.ask("show");
  CHECK(session.request == Request::kNothing);
}

TEST_CASE("status fits one line with everything at its largest") {
  Session session;
  Status& status = session.status;
  status.state = State::kLinked;
  status.lane = Lane::kCable;
  status.has_imu = status.has_profile = status.is_profile_unsaved = true;
  status.battery_millivolts = status.joins = 65535;
  status.calibration = 0x1B;
  status.recoveries = status.taps = status.rate_hz = 255;
  status.readings = status.skipped = status.unsent = status.damaged_frames = 4294967295;
  status.dropped.malformed = status.dropped.foreign = status.dropped.forged = status.dropped.replayed = 65535;
  status.radio = {{255, 255, 255}, -128};
  const std::string answer = session.ask("status");
  CHECK(answer.find(" radio 255.255.255 -128 dBm recoveries 255 ") != std::string::npos);
  CHECK(answer.rfind("ok state linked way cable imu ok battery 65535 mV calibration", 0) == 0);
  CHECK(answer.find("calibration 0 1 2 3 profile unsaved ") != std::string::npos);
  CHECK(answer.substr(answer.size() - 14) == "replayed 65535");
}

TEST_CASE("each state has its word") {
  Session session;
  CHECK(session.ask("status").find("state unprovisioned way none imu none") != std::string::npos);
  session.status.state = State::kJoining;
  CHECK(session.ask("status").find("state joining") != std::string::npos);
  session.status.state = State::kGreeting;
  CHECK(session.ask("status").find("state greeting") != std::string::npos);
}

TEST_CASE("the radio's own firmware and its signal are told, where they are known") {
  Session session;
  CHECK(session.ask("status").find(" radio unknown ") != std::string::npos);
  session.status.radio = {{19, 6, 1}, -62};
  CHECK(session.ask("status").find(" radio 19.6.1 -62 dBm ") != std::string::npos);
  session.status.radio.rssi_dbm = 0;
  CHECK(session.ask("status").find(" radio 19.6.1 recoveries ") != std::string::npos);
}

TEST_CASE("a version is three numbers, whatever follows") {
  const struct {
    const char* text;
    uint8_t version[3];
  } versions[] = {{"19.6.1", {19, 6, 1}}, {"19.5.4 Ver 2", {19, 5, 4}},
                  {"0.0.0", {0, 0, 0}},   {"19.6", {0, 0, 0}},
                  {"", {0, 0, 0}},        {"19.256.1", {0, 0, 0}},
                  {"19..1", {0, 0, 0}},   {"v19.6.1", {0, 0, 0}}};
  for (const auto& known : versions) {
    CAPTURE(known.text);
    uint8_t version[3] = {9, 9, 9};
    parse_version(known.text, version);
    CHECK(memcmp(version, known.version, sizeof version) == 0);
  }
}

TEST_CASE("help names every command") {
  Session session;
  const std::string help = session.ask("help");
  for (const char* command :
       {"id", "show", "status", "device", "key", "name", "network", "password", "port", "fusion", "crystal",
        "axes", "save", "forget", "prove", "strobe", "calibration save", "restart"})
    CHECK(help.find(command) != std::string::npos);
  CHECK(help.substr(help.size() - 7) == "restart");
}

TEST_CASE("what is unknown is named, unless it could be a secret") {
  Session session;
  CHECK(session.ask("dance") == "error: unknown command 'dance'; type help");
  CHECK(session.ask("dance wildly") == "error: unknown command 'dance'; type help");
  CHECK(session.ask("set colour red") == "error: unknown setting 'colour'; type help");
  CHECK(session.ask(kKeyAsHex) == "error: unknown command; type help");
  CHECK(session.ask("Tr0ub4dor&3") == "error: unknown command; type help");
  CHECK(session.ask("set") == "error: unknown setting; type help");
  CHECK(session.ask("settings") == "error: unknown command 'settings'; type help");
  CHECK(session.ask("save ") == "error: unknown command 'save'; type help");
  CHECK(session.ask(" id") == "error: unknown command; type help");
}

TEST_CASE("control characters are refused whole") {
  Session session;
  CHECK(is_error(session.ask("set name left\x1B[2J")));
  CHECK(is_error(session.ask("set network \x01\x02")));
  CHECK(is_error(session.ask("\x07")));
  CHECK(session.console.draft().name[0] == '\0');
  CHECK(session.request == Request::kNothing);
}

TEST_CASE("no answer holds the key or the password, whatever is asked") {
  Session session;
  session.provision();
  const char* lines[] = {"id",
                         "show",
                         "status",
                         "help",
                         "save",
                         "forget",
                         "strobe",
                         "restart",
                         "set key",
                         "set password",
                         "set password short",
                         "prove 0000000000000000",
                         "set key zz",
                         "get key",
                         "show key",
                         "show password",
                         "calibration",
                         "set name break a leg",
                         "set network break a leg and more than fits into a name",
                         "set device 000102030405060708090a0b0c0d0e0f",
                         "key 000102030405060708090a0b0c0d0e0f"};
  for (const char* line : lines) {
    CAPTURE(line);
    const std::string answer = session.ask(line);
    CHECK(answer.find("0001020304") == std::string::npos);
    CHECK(answer.find("break a leg") == std::string::npos);
  }
}

TEST_CASE("any bytes at all are answered with one line") {
  Session session;
  uint32_t noise = 7;
  for (int i = 0; i < 20'000; ++i) {
    char line[129];
    noise = noise * 1664525 + 1013904223;
    const size_t length = noise >> 25;
    for (size_t at = 0; at < length; ++at) {
      noise = noise * 1664525 + 1013904223;
      line[at] = static_cast<char>((noise >> 24) % 255 + 1);
    }
    line[length] = '\0';
    const std::string answer = session.ask(line);
    CHECK((answer.substr(0, 2) == "ok" || is_error(answer)));
    CHECK(answer.find('\n') == std::string::npos);
  }
}

TEST_CASE("an answer that does not fit is cut, not written beyond its end") {
  Answer answer;
  for (int i = 0; i < 100; ++i) answer.add("0123456789").add_number(4294967295).add_hex(0xFFFFFFFFu);
  CHECK(answer.count() == Answer::kRoom - 1);
  CHECK(strlen(answer.text()) == Answer::kRoom - 1);
}
