// CGAL's compute_vcm and vcm_is_on_feature_edge, as its example edges_example.cpp. Out: uint8 a point, 1 on an edge.
#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/property_map.h>
#include <CGAL/vcm_estimate_edges.h>

#include <array>
#include <utility>

#include "raw.hpp"

using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
using PointVector = std::pair<Kernel::Point_3, Kernel::Vector_3>;

static void detect(const Raw& raw, const std::string& out, const Options& options) {
  std::vector<PointVector> points;
  std::vector<std::size_t> rows;
  for (std::size_t i = 0; i < static_cast<std::size_t>(raw.count); ++i) {
    if (!raw.finite(i)) continue;
    const double* p = raw.at(i);
    points.emplace_back(Kernel::Point_3(p[0], p[1], p[2]), CGAL::NULL_VECTOR);
    rows.push_back(i);
  }
  const auto begin = Clock::now();

  std::vector<std::array<double, 6>> covariances;
  CGAL::compute_vcm(points, covariances, options.number("offset_radius"), options.number("convolution_radius"),
                    CGAL::parameters::point_map(CGAL::First_of_pair_property_map<PointVector>()).geom_traits(Kernel()));
  const double threshold = options.number("threshold");
  std::vector<std::uint8_t> flags(static_cast<std::size_t>(raw.count), 0);
  for (std::size_t i = 0; i < rows.size(); ++i) {
    flags[rows[i]] = CGAL::vcm_is_on_feature_edge(covariances[i], threshold);
  }

  print_seconds(begin);
  write_raw(out, flags);
}

int main(int argc, char** argv) { return guarded(argc, argv, detect); }
