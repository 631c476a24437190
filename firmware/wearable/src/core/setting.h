// Parses, checks and stores `set ...`.
#pragma once

#include "answer.h"
#include "settings.h"

namespace bunraku {

// `what`: the setting's name, a space, its value. A value that breaks a rule changes nothing; the rule is the
// answer.
void change_setting(const char* what, Settings& settings, Answer& answer);

const char* fusion_name(Fusion fusion);
const char* crystal_name(bool has_crystal);

}  // namespace bunraku
