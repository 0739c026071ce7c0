#!/bin/sh
# Build the rivals in C++ from Debian's (or Ubuntu's) own packages into benchmarks/cache/rivals.
set -eu
here=$(cd "$(dirname "$0")" && pwd)
out="$here/../cache/rivals"
packages="cmake g++ libpcl-dev libcgal-dev libeigen3-dev"

if ! command -v cmake >/dev/null || ! command -v c++ >/dev/null; then
  echo "cmake or a C++ compiler is missing: sudo apt-get install $packages" >&2
  exit 1
fi
mkdir -p "$out"
cmake -S "$here/cpp" -B "$out/build" -DCMAKE_BUILD_TYPE=Release -DCMAKE_RUNTIME_OUTPUT_DIRECTORY="$out" -Wno-dev >"$out/configure.log" 2>&1 || {
  cat "$out/configure.log" >&2
  exit 1
}
cmake --build "$out/build" --parallel 2
missing=0
for program in pcl_organized pcl_boundary pcl_normals cgal_vcm; do
  if [ ! -x "$out/$program" ]; then
    echo "$program was not built: sudo apt-get install $packages" >&2
    missing=1
  fi
done
exit $missing
