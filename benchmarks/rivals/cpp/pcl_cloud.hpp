// The finite points of a raw file as a PCL cloud. PCL computes in float32, so the centroid is taken off first.
#pragma once

#include <pcl/point_cloud.h>
#include <pcl/point_types.h>

#include "raw.hpp"

struct FiniteCloud {
  pcl::PointCloud<pcl::PointXYZ>::Ptr cloud{new pcl::PointCloud<pcl::PointXYZ>};
  std::vector<std::size_t> rows;
  float viewpoint[3] = {0, 0, 0};  // up +Z from the centroid, far away, when the file knows none
};

inline FiniteCloud finite_cloud(const Raw& raw) {
  FiniteCloud out;
  double mean[3] = {0, 0, 0};
  for (std::size_t i = 0; i < static_cast<std::size_t>(raw.count); ++i) {
    if (!raw.finite(i)) continue;
    out.rows.push_back(i);
    for (int c = 0; c < 3; ++c) mean[c] += raw.at(i)[c];
  }
  for (double& value : mean) value /= static_cast<double>(out.rows.size());
  for (const std::size_t i : out.rows) {
    const double* p = raw.at(i);
    out.cloud->push_back(pcl::PointXYZ(static_cast<float>(p[0] - mean[0]), static_cast<float>(p[1] - mean[1]),
                                       static_cast<float>(p[2] - mean[2])));
  }
  const bool known = std::isfinite(raw.viewpoint[0]);
  for (int c = 0; c < 3; ++c) {
    out.viewpoint[c] = known ? static_cast<float>(raw.viewpoint[c] - mean[c]) : (c == 2 ? 1e6f : 0.f);
  }
  return out;
}
