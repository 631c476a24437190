// Words, hex digits and numbers, without a library and without echoing secrets.
#include "line_parsing.h"

#include <string.h>

namespace bunraku {
namespace {

constexpr uint8_t kLongestEcho = 16;

int8_t digit(char letter) {
  if (letter >= '0' && letter <= '9') return static_cast<int8_t>(letter - '0');
  if (letter >= 'a' && letter <= 'f') return static_cast<int8_t>(letter - 'a' + 10);
  if (letter >= 'A' && letter <= 'F') return static_cast<int8_t>(letter - 'A' + 10);
  return -1;
}

// Words that are surely no secret: short, lower-case letters.
bool may_echo(const char* word) {
  const size_t length = strspn(word, "abcdefghijklmnopqrstuvwxyz");
  return length > 0 && length <= kLongestEcho && (word[length] == '\0' || word[length] == ' ');
}

}  // namespace

const char* rest_after(const char* line, const char* word) {
  while (*word != '\0')
    if (*line++ != *word++) return nullptr;
  if (*line == '\0') return line;
  return *line == ' ' ? line + 1 : nullptr;
}

bool is_word(const char* text, uint8_t longest) {
  const size_t length = strlen(text);
  for (const char* at = text; *at != '\0'; ++at)
    if (*at <= ' ' || *at > '~') return false;
  return length >= 1 && length <= longest;
}

bool is_readable(const char* text) {
  for (; *text != '\0'; ++text) {
    const uint8_t byte = static_cast<uint8_t>(*text);
    if (byte < ' ' || byte == 0x7F) return false;
  }
  return true;
}

bool parse_hex(const char* text, uint8_t* bytes, uint8_t count, char end) {
  for (uint8_t i = 0; i < count; ++i, text += 2) {
    const int8_t high = digit(text[0]);
    const int8_t low = high < 0 ? high : digit(text[1]);
    if (low < 0) return false;
    bytes[i] = static_cast<uint8_t>(high << 4 | low);
  }
  return *text == end;
}

bool parse_version(const char* text, uint8_t (&version)[3]) {
  uint8_t parts[3];
  for (uint8_t i = 0; i < 3; ++i) {
    uint32_t value = 0;
    const char* at = text;
    for (; *at >= '0' && *at <= '9' && value <= UINT8_MAX; ++at)
      value = value * 10 + static_cast<uint32_t>(*at - '0');
    if (at == text || value > UINT8_MAX || (i < 2 && *at != '.')) {
      memset(version, 0, sizeof version);
      return false;
    }
    parts[i] = static_cast<uint8_t>(value);
    text = at + 1;
  }
  memcpy(version, parts, sizeof version);
  return true;
}

bool parse_port(const char* text, uint16_t& port) {
  uint32_t value = 0;
  const char* at = text;
  for (; *at >= '0' && *at <= '9' && value <= UINT16_MAX; ++at)
    value = value * 10 + static_cast<uint32_t>(*at - '0');
  if (at == text || *at != '\0' || value == 0 || value > UINT16_MAX) return false;
  port = static_cast<uint16_t>(value);
  return true;
}

void refuse(const char* kind, const char* line, Answer& answer) {
  answer.add("error: unknown ").add(kind);
  if (may_echo(line)) {
    answer.add(" '");
    for (; *line != '\0' && *line != ' '; ++line) {
      const char letter[2] = {*line, '\0'};
      answer.add(letter);
    }
    answer.add("'");
  }
  answer.add("; type help");
}

}  // namespace bunraku
