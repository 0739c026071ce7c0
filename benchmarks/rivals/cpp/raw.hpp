// The one file every rival reads, and the files they write. Little-endian, no padding.
//   in:  "EDGELRAW", int64 rows, int64 columns (0 0 when unorganized), int64 N, double viewpoint[3] (NaN when unknown),
//        double xyz[N][3] (NaN where the sensor saw nothing)
//   out: whatever the program says, one record a point of the input, finite or not
#pragma once

#include <chrono>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <fstream>
#include <iostream>
#include <limits>
#include <map>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

struct Raw {
  std::int64_t rows = 0, columns = 0, count = 0;
  double viewpoint[3] = {0, 0, 0};
  std::vector<double> xyz;

  const double* at(std::size_t i) const { return &xyz[3 * i]; }
  bool finite(std::size_t i) const {
    return std::isfinite(xyz[3 * i]) && std::isfinite(xyz[3 * i + 1]) && std::isfinite(xyz[3 * i + 2]);
  }
};

inline Raw read_raw(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  char magic[8] = {};
  Raw raw;
  file.read(magic, 8);
  file.read(reinterpret_cast<char*>(&raw.rows), 3 * sizeof(std::int64_t));
  file.read(reinterpret_cast<char*>(raw.viewpoint), sizeof(raw.viewpoint));
  if (!file || std::memcmp(magic, "EDGELRAW", 8) != 0) throw std::runtime_error(path + ": not an EDGELRAW file");
  raw.xyz.resize(3 * static_cast<std::size_t>(raw.count));
  file.read(reinterpret_cast<char*>(raw.xyz.data()), static_cast<std::streamsize>(raw.xyz.size() * sizeof(double)));
  if (!file) throw std::runtime_error(path + ": cut short");
  return raw;
}

template <typename T>
void write_raw(const std::string& path, const std::vector<T>& values) {
  std::ofstream file(path, std::ios::binary);
  file.write(reinterpret_cast<const char*>(values.data()), static_cast<std::streamsize>(values.size() * sizeof(T)));
  if (!file) throw std::runtime_error(path + ": cannot be written");
}

// key=value arguments after the two file names; lists are separated by commas.
class Options {
 public:
  Options(int argc, char** argv) {
    for (int i = 3; i < argc; ++i) {
      const std::string text = argv[i];
      const auto split = text.find('=');
      if (split == std::string::npos) throw std::runtime_error("expected key=value, got " + text);
      values_[text.substr(0, split)] = text.substr(split + 1);
    }
  }
  std::string text(const std::string& key) const {
    const auto found = values_.find(key);
    if (found == values_.end()) throw std::runtime_error("missing option " + key);
    return found->second;
  }
  double number(const std::string& key) const { return std::stod(text(key)); }
  std::vector<double> numbers(const std::string& key) const {
    std::vector<double> list;
    std::stringstream stream(text(key));
    for (std::string item; std::getline(stream, item, ',');) list.push_back(std::stod(item));
    return list;
  }

 private:
  std::map<std::string, std::string> values_;
};

using Clock = std::chrono::steady_clock;

inline void print_seconds(Clock::time_point begin) {
  std::cout.precision(9);
  std::cout << "seconds " << std::chrono::duration<double>(Clock::now() - begin).count() << std::endl;
}

template <typename Program>
int guarded(int argc, char** argv, Program program) {
  if (argc < 3) {
    std::cerr << "usage: " << argv[0] << " in.raw out.raw key=value..." << std::endl;
    return 2;
  }
  try {
    program(read_raw(argv[1]), std::string(argv[2]), Options(argc, argv));
  } catch (const std::exception& error) {
    std::cerr << argv[0] << ": " << error.what() << std::endl;
    return 1;
  }
  return 0;
}
