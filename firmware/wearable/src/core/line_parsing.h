// Taking a line of the console apart.
#pragma once

#include <stdint.h>

#include "answer.h"

namespace bunraku {

// If `line` starts with `word` and then ends or goes on behind a space: what comes behind; otherwise nullptr.
const char* rest_after(const char* line, const char* word);

bool is_word(const char* text, uint8_t longest);  // 1 to `longest` printable characters without spaces
bool is_readable(const char* text);               // no control characters; letters beyond ASCII may be

// Exactly `count` bytes and then `end`.
bool parse_hex(const char* text, uint8_t* bytes, uint8_t count, char end = '\0');
bool parse_version(const char* text, uint8_t (&version)[3]);  // 19.6.1, whatever follows; else zeros
bool parse_port(const char* text, uint16_t& port);  // 1 to 65535

// `error: unknown <kind> '<first word>'; type help`; the word only if it can be no secret.
void refuse(const char* kind, const char* line, Answer& answer);

}  // namespace bunraku
