// The console's commands. An unknown command changes nothing.
#include "console.h"

#include <string.h>

#include "blake2s.h"
#include "line_parsing.h"
#include "setting.h"
#include "version.h"

namespace bunraku {
namespace {

constexpr uint8_t kProofBytes = 8;
constexpr char kProof[] = "prove";

const char* set_or_none(bool is_set) { return is_set ? "set" : "none"; }

const char* state_name(State state) {
  switch (state) {
    case State::kLinked: return "linked";
    case State::kGreeting: return "greeting";
    case State::kJoining: return "joining";
    default: return "unprovisioned";
  }
}

const char* lane_name(Lane lane) { return lane == Lane::kWifi ? "wifi" : lane == Lane::kCable ? "cable" : "none"; }

void identify(const Status& status, uint32_t board_number, Answer& answer) {
  answer.add("ok bunraku-wearable ").add(kFirmwareVersion).add(" wire ").add_hex(wire::kWireHash);
  answer.add(" imu ");
  if (status.has_imu_id)
    answer.add_hex(status.imu_id, sizeof status.imu_id);
  else
    answer.add("none");
  answer.add(" board ").add_hex(board_number);
}

void tell(const Radio& radio, Answer& answer) {
  answer.add(" radio ");
  if (!radio.is_known()) {
    answer.add("unknown");
    return;
  }
  answer.add_number(radio.firmware[0]).add(".").add_number(radio.firmware[1]).add(".");
  answer.add_number(radio.firmware[2]);
  if (radio.rssi_dbm == 0) return;
  answer.add(radio.rssi_dbm < 0 ? " -" : " ");
  answer.add_number(static_cast<uint32_t>(radio.rssi_dbm < 0 ? -radio.rssi_dbm : radio.rssi_dbm)).add(" dBm");
}

void tell(const Status& status, Answer& answer) {
  answer.add("ok state ").add(state_name(status.state)).add(" way ").add(lane_name(status.lane));
  answer.add(" imu ").add(status.has_imu ? "ok" : "none");
  answer.add(" battery ").add_number(status.battery_millivolts).add(" mV calibration");
  for (int8_t shift = 6; shift >= 0; shift = static_cast<int8_t>(shift - 2))
    answer.add(" ").add_number(status.calibration >> shift & 3u);
  const bool is_unsaved = status.has_profile && status.is_profile_unsaved;
  answer.add(" profile ").add(is_unsaved ? "unsaved" : set_or_none(status.has_profile));
  tell(status.radio, answer);
  answer.add(" recoveries ").add_number(status.recoveries).add(" taps ").add_number(status.taps);
  answer.add(" sent ").add_number(status.readings);
  answer.add(" skipped ").add_number(status.skipped).add(" unsent ").add_number(status.unsent);
  answer.add(" joins ").add_number(status.joins).add(" damaged ").add_number(status.damaged_frames);
  const PairingCounts& dropped = status.dropped;
  answer.add(" malformed ").add_number(dropped.malformed).add(" foreign ").add_number(dropped.foreign);
  answer.add(" forged ").add_number(dropped.forged).add(" replayed ").add_number(dropped.replayed);
}

}  // namespace

Request Console::execute(const char* line, const Status& status, uint32_t board_number, Answer& answer) {
  answer.clear();
  const char* rest;
  if (!is_readable(line)) {
    answer.add("error: unreadable line, nothing was done; type help");
  } else if ((rest = rest_after(line, "set")) != nullptr) {
    change_setting(rest, draft_, answer);
  } else if ((rest = rest_after(line, "prove")) != nullptr) {
    prove(rest, answer);
  } else if (strcmp(line, "id") == 0) {
    identify(status, board_number, answer);
  } else if (strcmp(line, "show") == 0) {
    show(answer);
  } else if (strcmp(line, "status") == 0) {
    tell(status, answer);
  } else if (strcmp(line, "help") == 0) {
    answer.add(
        "ok id, show, status, set device|key|name|network|password|port|fusion|crystal|axes <value>, save, ");
    answer.add("forget, prove <nonce>, strobe, calibration save, restart");
  } else {
    return request(line, answer);
  }
  return Request::kNothing;
}

Request Console::request(const char* line, Answer& answer) const {
  static constexpr struct {
    const char* line;
    const char* answer;
    Request request;
  } kRequests[] = {{"save", "ok saved", Request::kSave},
                   {"forget", "ok forgotten", Request::kForget},
                   {"strobe", "ok", Request::kStrobe},
                   {"calibration save", "ok saving; the lamp is on meanwhile", Request::kSaveCalibration},
                   {"restart", "ok restarting", Request::kRestart}};
  for (const auto& known : kRequests) {
    if (strcmp(line, known.line) != 0) continue;
    answer.add(known.answer);
    return known.request;
  }
  refuse("command", line, answer);
  return Request::kNothing;
}

void Console::show(Answer& answer) const {
  answer.add("ok name ").add(draft_.name[0] != '\0' ? draft_.name : "none").add(" device ");
  if (draft_.device_id != 0)
    answer.add_hex(draft_.device_id);
  else
    answer.add("none");
  answer.add(" key ").add(set_or_none(draft_.has_key));
  answer.add(" password ").add(set_or_none(draft_.password[0] != '\0'));
  answer.add(" port ").add_number(draft_.port).add(" fusion ").add(fusion_name(draft_.imu.fusion));
  answer.add(" crystal ").add(crystal_name(draft_.imu.has_crystal));
  answer.add(" axes ").add_hex(&draft_.imu.axis_map, 1).add(" ").add_hex(&draft_.imu.axis_sign, 1);
  answer.add(" network ").add(draft_.network);
}

void Console::prove(const char* nonce, Answer& answer) const {
  constexpr uint8_t kWordBytes = sizeof kProof - 1;
  uint8_t message[kWordBytes + kProofBytes];
  uint8_t proof[kProofBytes];
  memcpy(message, kProof, kWordBytes);
  if (!draft_.has_key) {
    answer.add("error: there is no key; provision this wearable");
  } else if (!parse_hex(nonce, message + kWordBytes, kProofBytes)) {
    answer.add("error: a nonce is 16 hex digits");
  } else {
    blake2s({draft_.key, sizeof draft_.key, message, sizeof message}, proof, sizeof proof);
    answer.add("ok ").add_hex(proof, sizeof proof);
  }
}

}  // namespace bunraku
