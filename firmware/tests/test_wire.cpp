// The firmware's packets against the golden vectors: each decoded to its fields, each made from them.
#include <doctest/doctest.h>

#include <cmath>
#include <string>
#include <vector>

#include "blake2s.h"
#include "golden.h"
#include "wire.h"

using namespace bunraku;

namespace {

// Every field of every packet by its name; `visit` checks or fills it.
#define VISIT(field) visit(#field, packet.field);
#define FIELDS(Packet, LIST)                        \
  template <typename Visit>                         \
  void fields(wire::Packet& packet, Visit& visit) { \
    LIST(VISIT)                                     \
  }
FIELDS(Hello, BUNRAKU_HELLO)
FIELDS(Assignment, BUNRAKU_ASSIGNMENT)
FIELDS(Reading, BUNRAKU_READING)
FIELDS(Heartbeat, BUNRAKU_HEARTBEAT)
FIELDS(Call, BUNRAKU_CALL)
FIELDS(Profile, BUNRAKU_PROFILE)
FIELDS(Restore, BUNRAKU_RESTORE)

int16_t q14(double value) { return static_cast<int16_t>(std::lround(value * 16384)); }

struct Check {
  const golden::Value& values;
  size_t visited = 0;

  template <typename Number>
  void operator()(const char* name, Number& field) {
    CHECK_MESSAGE(field == static_cast<Number>(values[name].number), name);
    ++visited;
  }
  void operator()(const char* name, int16_t (&field)[4]) {
    for (size_t i = 0; i < 4; ++i) CHECK_MESSAGE(field[i] == q14(values[name].items.at(i).number), name);
    ++visited;
  }
  template <size_t count>
  void operator()(const char* name, uint8_t (&field)[count]) {
    CHECK_MESSAGE(std::vector<uint8_t>(field, field + count) == values[name].bytes(), name);
    ++visited;
  }
};

struct Fill {
  const golden::Value& values;

  template <typename Number>
  void operator()(const char* name, Number& field) {
    field = static_cast<Number>(values[name].number);
  }
  void operator()(const char* name, int16_t (&field)[4]) {
    for (size_t i = 0; i < 4; ++i) field[i] = q14(values[name].items.at(i).number);
  }
  template <size_t count>
  void operator()(const char* name, uint8_t (&field)[count]) {
    const auto bytes = values[name].bytes();
    REQUIRE(bytes.size() == count);
    std::copy(bytes.begin(), bytes.end(), field);
  }
};

template <typename Packet>
void compare(const golden::Value& vector, const std::vector<uint8_t>& key) {
  const auto datagram = vector["datagram"].bytes();
  REQUIRE(datagram.size() == Packet::kSize);
  CHECK(datagram[3] == Packet::kKind);
  CHECK(Packet::kSignedBytes + wire::kTagBytes == Packet::kSize);

  Packet decoded;
  decoded.read(datagram.data());
  Check check = {vector["fields"]};
  fields(decoded, check);
  CHECK(check.visited == vector["fields"].members.size());

  Packet filled;
  Fill fill = {vector["fields"]};
  fields(filled, fill);
  std::vector<uint8_t> made(Packet::kSize);
  filled.write(made.data());
  blake2s({key.data(), static_cast<uint8_t>(key.size()), made.data(), Packet::kSignedBytes},
          made.data() + Packet::kSignedBytes, wire::kTagBytes);
  CHECK(made == datagram);
}

}  // namespace

TEST_CASE("every golden packet is decoded and made, bit for bit") {
  const golden::Value wire_json = golden::load("wire.json");
  CHECK(static_cast<uint32_t>(wire_json["wire_hash"].number) == wire::kWireHash);
  const auto key = wire_json["key"].bytes();
  std::map<std::string, int> seen;
  for (const golden::Value& vector : wire_json["packets"].items) {
    const std::string& packet = vector["packet"].text;
    CAPTURE(packet);
    ++seen[packet];
    if (packet == "Hello") compare<wire::Hello>(vector, key);
    if (packet == "Assignment") compare<wire::Assignment>(vector, key);
    if (packet == "Reading") compare<wire::Reading>(vector, key);
    if (packet == "Heartbeat") compare<wire::Heartbeat>(vector, key);
    if (packet == "Call") compare<wire::Call>(vector, key);
    if (packet == "Profile") compare<wire::Profile>(vector, key);
    if (packet == "Restore") compare<wire::Restore>(vector, key);
  }
  CHECK(seen.size() == 7);
}
