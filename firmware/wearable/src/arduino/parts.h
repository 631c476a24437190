// The parts of this board, by the same names on each: what the sketch joins.
#pragma once

#include "board.h"
#include "board_clock.h"

#ifdef BUNRAKU_SAMD

#include "../core/bno055.h"
#include "samd/mkr_board.h"
#include "samd/nvm_store.h"
#include "samd/usb_serial.h"
#include "samd/wire_bus.h"
#ifdef BUNRAKU_NINA
#include "samd/nina_link.h"
#else
#include "samd/winc_link.h"
#endif

namespace bunraku {
namespace parts {

using Board = MkrBoard;
using Bus = WireBus;
using Cable = UsbSerial;
using Driver = Bno055;
using Lamp = BuiltinLed;
using Store = NvmStore;
#ifdef BUNRAKU_NINA
using Wifi = NinaLink;
#else
using Wifi = WincLink;
#endif

}  // namespace parts
}  // namespace bunraku

#else

#include "../core/any_imu.h"
#include "esp32/esp32_board.h"
#include "esp32/i2c_bus.h"
#include "esp32/nvs_store.h"
#include "esp32/udp_link.h"
#include "esp32/usb_cable.h"

namespace bunraku {
namespace parts {

using Board = Esp32Board;
using Bus = Esp32Bus;
using Cable = UsbCable;
using Driver = AnyImu;
using Lamp = Esp32Lamp;
using Store = NvsStore;
using Wifi = UdpLink;

}  // namespace parts
}  // namespace bunraku

#endif
