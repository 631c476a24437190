// The registers of the SAM D21 that the sketch uses, by their names in the CMSIS headers; values from the data sheet.
#pragma once

#include <stdint.h>

struct Register8 {
  volatile uint8_t reg;
};
struct Register16 {
  volatile uint16_t reg;
};
struct Register32 {
  volatile uint32_t reg;
};

struct SercomI2cm {
  Register32 CTRLA;
  Register16 STATUS;
  const Register32 SYNCBUSY;
};
struct Sercom {
  SercomI2cm I2CM;
};
struct UsbDeviceEndpoint {
  const Register8 EPSTATUS;
  Register8 EPINTFLAG;
};
struct UsbDevice {
  const Register16 FNUM;
  UsbDeviceEndpoint DeviceEndpoint[8];
};
struct Usb {
  UsbDevice DEVICE;
};
struct Nvmctrl {
  Register16 CTRLA;
  Register32 CTRLB;
  Register8 INTFLAG;
  Register32 ADDR;
};
struct Wdt {
  Register8 CTRL, CONFIG;
  const Register8 STATUS;
  Register8 CLEAR;
};
struct Gclk {
  const Register8 STATUS;
  Register16 CLKCTRL;
  Register32 GENCTRL, GENDIV;
};
struct PowerManager {
  const Register8 RCAUSE;
};
struct SysTick_Type {
  volatile uint32_t CTRL, LOAD, VAL;
};

extern Sercom* const SERCOM0;
extern Usb* const USB;
extern Nvmctrl* const NVMCTRL;
extern Wdt* const WDT;
extern Gclk* const GCLK;
extern PowerManager* const PM;
extern SysTick_Type* const SysTick;

extern "C" void NVIC_SystemReset();

constexpr uint32_t SERCOM_I2CM_CTRLA_ENABLE = 1ul << 1, SERCOM_I2CM_CTRLA_LOWTOUTEN = 1ul << 30;
constexpr uint32_t SERCOM_I2CM_SYNCBUSY_ENABLE = 1ul << 1, SERCOM_I2CM_SYNCBUSY_SYSOP = 1ul << 2;
#define SERCOM_I2CM_STATUS_BUSSTATE(value) (0x30ul & ((value) << 4))

constexpr uint32_t USB_DEVICE_EPSTATUS_BK1RDY = 1ul << 7;
constexpr int USB_DEVICE_EPINTFLAG_TRCPT1 = 1 << 1;

constexpr uint32_t NVMCTRL_CTRLA_CMD_ER = 0x02, NVMCTRL_CTRLA_CMD_WP = 0x04, NVMCTRL_CTRLA_CMD_PBC = 0x44;
constexpr uint32_t NVMCTRL_CTRLA_CMD_INVALL = 0x46, NVMCTRL_CTRLA_CMDEX_KEY = 0xA500;
constexpr uint32_t NVMCTRL_CTRLB_MANW = 1ul << 7, NVMCTRL_INTFLAG_READY = 1;

constexpr uint32_t WDT_CTRL_ENABLE = 1ul << 1, WDT_CONFIG_PER_16K = 0xB, WDT_STATUS_SYNCBUSY = 1ul << 7;
constexpr uint32_t WDT_CLEAR_CLEAR_KEY = 0xA5;
constexpr uint32_t PM_RCAUSE_WDT = 1ul << 5;

constexpr uint32_t GCLK_STATUS_SYNCBUSY = 1ul << 7, GCLK_CLKCTRL_CLKEN = 1ul << 14;
constexpr uint32_t GCLK_CLKCTRL_ID_SERCOMX_SLOW = 0x13, GCLK_CLKCTRL_GEN_GCLK1 = 1ul << 8;
constexpr uint32_t GCLK_GENCTRL_SRC_OSCULP32K = 3ul << 8, GCLK_GENCTRL_GENEN = 1ul << 16;
constexpr uint32_t GCLK_GENCTRL_DIVSEL = 1ul << 20;
#define GCLK_CLKCTRL_ID(value) (0x3Ful & (value))
#define GCLK_CLKCTRL_GEN(value) (0xF00ul & ((value) << 8))
#define GCLK_GENCTRL_ID(value) (0xFul & (value))
#define GCLK_GENDIV_ID(value) (0xFul & (value))
#define GCLK_GENDIV_DIV(value) (0xFFFF00ul & ((value) << 8))
