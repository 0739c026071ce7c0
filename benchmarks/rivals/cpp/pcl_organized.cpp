// PCL's OrganizedEdgeFromNormals on normals of IntegralImageNormalEstimation, as apps/src/openni_organized_edge_detection
// uses them. Out: uint8 a point, PCL's own label bits.
#include <pcl/features/integral_image_normal.h>
#include <pcl/features/organized_edge_detection.h>
#include <pcl/point_cloud.h>
#include <pcl/point_types.h>

#include "raw.hpp"

using Cloud = pcl::PointCloud<pcl::PointXYZ>;
using Normals = pcl::PointCloud<pcl::Normal>;

// PCL expects a camera at the origin that looks along +Z, and metres: p -> axes (p - origin) * scale.
static Cloud::Ptr in_sensor_frame(const Raw& raw, const Options& options) {
  const auto axes = options.numbers("axes");
  const auto origin = options.numbers("origin");
  const double scale = options.number("scale");
  Cloud::Ptr cloud(new Cloud(static_cast<std::uint32_t>(raw.columns), static_cast<std::uint32_t>(raw.rows)));
  cloud->is_dense = false;
  for (std::size_t i = 0; i < static_cast<std::size_t>(raw.count); ++i) {
    for (int c = 0; c < 3; ++c) {
      double sum = 0;
      for (int d = 0; d < 3; ++d) sum += axes[3 * c + d] * (raw.at(i)[d] - origin[d]);
      (*cloud)[i].data[c] = raw.finite(i) ? static_cast<float>(sum * scale) : std::numeric_limits<float>::quiet_NaN();
    }
  }
  return cloud;
}

// A view wider than a camera's has no common Z: there the edges are looked for in the range.
static Cloud::Ptr with_range_as_depth(const Cloud& cloud) {
  Cloud::Ptr ranges(new Cloud(cloud));
  for (auto& point : *ranges) point.z = point.getVector3fMap().norm();
  return ranges;
}

static void detect(const Raw& raw, const std::string& out, const Options& options) {
  const Cloud::Ptr cloud = in_sensor_frame(raw, options);
  const Cloud::Ptr depth = options.number("use_range") != 0 ? with_range_as_depth(*cloud) : cloud;
  const auto begin = Clock::now();

  using Estimation = pcl::IntegralImageNormalEstimation<pcl::PointXYZ, pcl::Normal>;
  const std::map<std::string, Estimation::NormalEstimationMethod> methods{
      {"covariance", Estimation::COVARIANCE_MATRIX},
      {"gradient", Estimation::AVERAGE_3D_GRADIENT},
      {"depth_change", Estimation::AVERAGE_DEPTH_CHANGE}};
  Normals::Ptr normals(new Normals);
  Estimation estimation;
  estimation.setNormalEstimationMethod(methods.at(options.text("method")));
  estimation.setNormalSmoothingSize(static_cast<float>(options.number("smoothing")));
  estimation.setMaxDepthChangeFactor(static_cast<float>(options.number("max_depth_change")));
  estimation.setBorderPolicy(Estimation::BORDER_POLICY_MIRROR);
  estimation.setInputCloud(cloud);
  estimation.compute(*normals);

  pcl::OrganizedEdgeFromNormals<pcl::PointXYZ, pcl::Normal, pcl::Label> edges;
  edges.setInputCloud(depth);
  edges.setInputNormals(normals);
  edges.setDepthDisconThreshold(static_cast<float>(options.number("depth_threshold")));
  edges.setMaxSearchNeighbors(static_cast<int>(options.number("max_search")));
  edges.setHCCannyLowThreshold(static_cast<float>(options.number("low")));
  edges.setHCCannyHighThreshold(static_cast<float>(options.number("high")));
  pcl::PointCloud<pcl::Label> labels;
  std::vector<pcl::PointIndices> by_kind;
  edges.compute(labels, by_kind);

  print_seconds(begin);
  std::vector<std::uint8_t> bits(labels.size());
  for (std::size_t i = 0; i < bits.size(); ++i) bits[i] = raw.finite(i) ? static_cast<std::uint8_t>(labels[i].label) : 0;
  write_raw(out, bits);
}

int main(int argc, char** argv) { return guarded(argc, argv, detect); }
