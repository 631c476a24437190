// Reads the golden vectors (tests/golden/*.json): as much JSON as they need.
#pragma once

#include <cstdlib>
#include <fstream>
#include <map>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

namespace bunraku {
namespace golden {

struct Value {
  double number = 0;
  std::string text;
  std::vector<Value> items;
  std::map<std::string, Value> members;

  const Value& operator[](const std::string& name) const { return members.at(name); }
  std::vector<uint8_t> bytes() const {  // bytes of hexadecimal text
    std::vector<uint8_t> all;
    for (size_t at = 0; at + 1 < text.size(); at += 2)
      all.push_back(static_cast<uint8_t>(std::stoul(text.substr(at, 2), nullptr, 16)));
    return all;
  }
};

class Reader {
 public:
  explicit Reader(const std::string& text) : text_(text) {}

  Value value() {
    Value read;
    const char first = next();
    if (first == '{') {
      ++at_;
      while (next() != '}') {
        const std::string name = string();
        expect(':');
        read.members[name] = value();
        if (next() == ',') ++at_;
      }
      ++at_;
    } else if (first == '[') {
      ++at_;
      while (next() != ']') {
        read.items.push_back(value());
        if (next() == ',') ++at_;
      }
      ++at_;
    } else if (first == '"') {
      read.text = string();
    } else {
      char* end = nullptr;
      read.number = std::strtod(text_.c_str() + at_, &end);
      const size_t behind = static_cast<size_t>(end - text_.c_str());
      if (behind == at_) throw std::runtime_error("not the JSON of the golden vectors");
      at_ = behind;
    }
    return read;
  }

 private:
  char next() {
    while (at_ < text_.size() && (text_[at_] == ' ' || text_[at_] == '\n')) ++at_;
    if (at_ >= text_.size()) throw std::runtime_error("golden vectors end too early");
    return text_[at_];
  }
  void expect(char sign) {
    if (next() != sign) throw std::runtime_error("not the JSON of the golden vectors");
    ++at_;
  }
  std::string string() {
    expect('"');
    const size_t end = text_.find('"', at_);
    if (end == std::string::npos) throw std::runtime_error("golden vectors end too early");
    const std::string read = text_.substr(at_, end - at_);
    at_ = end + 1;
    return read;
  }

  std::string text_;
  size_t at_ = 0;
};

inline Value load(const std::string& name) {
  std::ifstream file(std::string(BUNRAKU_GOLDEN_DIR) + "/" + name);
  if (!file) throw std::runtime_error("there is no " + name + " in " BUNRAKU_GOLDEN_DIR);
  std::stringstream text;
  text << file.rdbuf();
  return Reader(text.str()).value();
}

}  // namespace golden
}  // namespace bunraku
