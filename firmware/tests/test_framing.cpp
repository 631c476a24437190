// Frames against the golden vectors; packets and text told apart on one line, whatever is lost or damaged.
#include <doctest/doctest.h>

#include <string>
#include <vector>

#include "fakes.h"
#include "framing.h"
#include "golden.h"

using namespace bunraku;
using fakes::Bytes;
using Found = CableInput::Found;

namespace {

Bytes framed(const Bytes& packet) {
  uint8_t out[kLongestFrame];
  const uint8_t count = frame(packet.data(), static_cast<uint8_t>(packet.size()), out);
  return Bytes(out, out + count);
}

Bytes text(const std::string& line) { return Bytes(line.begin(), line.end()); }

// Feeds everything and returns what was found, as "packet:<bytes>", "line:<text>", "overlong".
struct Line {
  CableInput input;
  uint32_t now_us = 0xFFFFFFF0;  // shortly before the clock's wrap
  std::vector<std::string> found;

  void feed(const Bytes& bytes, uint32_t apart_us = 10) {
    for (const uint8_t byte : bytes) {
      now_us += apart_us;
      const Found now = input.feed(byte, now_us);
      if (now == Found::kPacket)
        found.push_back("packet:" + std::string(input.packet(), input.packet() + input.packet_bytes()));
      if (now == Found::kLine) found.push_back(std::string("line:") + input.line());
      if (now == Found::kOverlongLine) found.push_back("overlong");
    }
  }
};

using Findings = std::vector<std::string>;

}  // namespace

TEST_CASE("CRC-16/XMODEM check value") { CHECK(crc16(text("123456789").data(), 9) == 0x31C3); }

TEST_CASE("every golden frame is made and undone") {
  const golden::Value framing_json = golden::load("wire_framing.json");
  for (const golden::Value& vector : framing_json["frames"].items) {
    const Bytes payload = vector["payload"].bytes(), stuffed = vector["frame"].bytes();
    Bytes expected = {0};
    expected.insert(expected.end(), stuffed.begin(), stuffed.end());
    CHECK(framed(payload) == expected);
    Bytes undone(stuffed.begin(), stuffed.end() - 1);
    REQUIRE(unframe(undone.data(), static_cast<uint8_t>(undone.size())) == payload.size());
    CHECK(Bytes(undone.begin(), undone.begin() + static_cast<long>(payload.size())) == payload);
  }
}

TEST_CASE("the longest packet fits, whatever is in it") {
  for (const uint8_t filling : {uint8_t{0}, uint8_t{1}, uint8_t{255}}) {
    const Bytes packet(wire::kLargest, filling);
    Line line;
    line.feed(framed(packet));
    CHECK(line.found == Findings{"packet:" + std::string(packet.begin(), packet.end())});
  }
}

TEST_CASE("one flipped bit anywhere in a frame gives no packet") {
  const Bytes whole = framed({1, 0, 2, 0, 0, 3, 255});
  for (size_t at = 1; at + 1 < whole.size(); ++at) {
    for (uint8_t bit = 0; bit < 8; ++bit) {
      Bytes damaged = whole;
      damaged[at] = static_cast<uint8_t>(damaged[at] ^ 1 << bit);
      Line line;
      line.feed(damaged);
      for (const std::string& found : line.found) CHECK(found.substr(0, 7) != "packet:");
    }
  }
}

TEST_CASE("text and packets take turns") {
  Line line;
  line.feed(text("id\r\n"));
  line.feed(framed({7}));
  line.feed(text("status\n"));
  line.feed(framed({8}));
  line.feed(framed({9}));
  line.feed(text("show\r"));
  CHECK(line.found ==
        Findings{"line:id", "packet:\x07", "line:status", "packet:\x08", "packet:\x09", "line:show"});
  CHECK(line.input.damaged() == 0);
}

TEST_CASE("a packet drops the line begun before it") {
  Line line;
  line.feed(text("set name lef"));
  line.feed(framed({7}));
  line.feed(text("id\n"));
  CHECK(line.found == Findings{"packet:\x07", "line:id"});
}

TEST_CASE("one lost zero byte costs at most what stood beside it") {
  for (const bool is_first_lost : {true, false}) {
    Bytes broken = framed({1, 2, 3});
    is_first_lost ? broken.erase(broken.begin()) : broken.erase(broken.end() - 1);
    Line line;
    line.feed(broken);
    line.feed(framed({4, 5, 6}));
    line.feed(framed({7, 8, 9}));
    REQUIRE(line.found.size() >= 1);
    CHECK(line.found.back() == "packet:\x07\x08\x09");
  }
}

TEST_CASE("silence ends a packet that never ended, so that a person is heard") {
  Line line;
  line.feed({0, 5, 5, 5});
  line.now_us += 300'000;
  line.feed(text("id\n"));
  CHECK(line.found == Findings{"line:id"});
}

TEST_CASE("a slow typist is no silence") {
  Line line;
  line.feed(text("id\n"), 2'000'000);
  CHECK(line.found == Findings{"line:id"});
}

TEST_CASE("backspace takes back, and not beyond the beginning") {
  Line line;
  line.feed(
      text("\b\bix\x7F"
           "d\n"));
  CHECK(line.found == Findings{"line:id"});
}

TEST_CASE("empty lines are nothing; overlong ones are refused whole and the next one counts") {
  Line line;
  line.feed(text("\r\n\n\n"));
  line.feed(text(std::string(kLongestLine, 'x') + "\n"));
  line.feed(text(std::string(kLongestLine + 1u, 'y') + "\n"));
  line.feed(text(std::string(1000, 'z') + "\nid\n"));
  CHECK(line.found == Findings{"line:" + std::string(kLongestLine, 'x'), "overlong", "overlong", "line:id"});
}

TEST_CASE("an overlong packet is counted, and the next one counts") {
  Line line;
  Bytes overlong(500, 1);
  overlong.front() = overlong.back() = 0;
  line.feed(overlong);
  line.feed(framed({7}));
  CHECK(line.found == Findings{"packet:\x07"});
  CHECK(line.input.damaged() == 1);
}

TEST_CASE("output takes frames whole or not at all, in order, however little the host takes") {
  CableOutput output;
  fakes::FakeSerial serial;
  serial.room_to_host = 7;
  Bytes sent;
  for (uint8_t i = 0; i < 100; ++i) {
    const Bytes packet(40, i);
    if (output.put(packet.data(), static_cast<uint16_t>(packet.size())))
      sent.insert(sent.end(), packet.begin(), packet.end());
    output.flush(serial);
  }
  CHECK(sent.size() < 100 * 40);
  CHECK(sent.size() > 300);
  for (uint8_t i = 0; i < 100; ++i) output.flush(serial);
  CHECK(serial.to_host == sent);
  CHECK(output.has_room(320));
  CHECK_FALSE(output.has_room(321));
}
