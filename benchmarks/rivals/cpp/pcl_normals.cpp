// PCL's NormalEstimationOMP over the k nearest neighbours, the search tree included. Out: float32 x 3 a point.
#include <pcl/features/normal_3d_omp.h>
#include <pcl/search/kdtree.h>

#include "pcl_cloud.hpp"

static void estimate(const Raw& raw, const std::string& out, const Options& options) {
  const FiniteCloud finite = finite_cloud(raw);
  const auto begin = Clock::now();

  pcl::search::KdTree<pcl::PointXYZ>::Ptr tree(new pcl::search::KdTree<pcl::PointXYZ>);
  pcl::PointCloud<pcl::Normal> normals;
  pcl::NormalEstimationOMP<pcl::PointXYZ, pcl::Normal> estimation(static_cast<unsigned>(options.number("threads")));
  estimation.setInputCloud(finite.cloud);
  estimation.setSearchMethod(tree);
  estimation.setViewPoint(finite.viewpoint[0], finite.viewpoint[1], finite.viewpoint[2]);
  estimation.setKSearch(static_cast<int>(options.number("k")));
  estimation.compute(normals);

  print_seconds(begin);
  std::vector<float> values(3 * static_cast<std::size_t>(raw.count), std::numeric_limits<float>::quiet_NaN());
  for (std::size_t i = 0; i < finite.rows.size(); ++i) {
    for (int c = 0; c < 3; ++c) values[3 * finite.rows[i] + c] = normals[i].normal[c];
  }
  write_raw(out, values);
}

int main(int argc, char** argv) { return guarded(argc, argv, estimate); }
