// PCL's BoundaryEstimation on normals of NormalEstimationOMP. Out: uint8 a point, 1 on a boundary.
// BoundaryEstimation has no parallel form; only the normals use the threads.
#include <pcl/features/boundary.h>
#include <pcl/features/normal_3d_omp.h>
#include <pcl/search/kdtree.h>

#include "pcl_cloud.hpp"

static void detect(const Raw& raw, const std::string& out, const Options& options) {
  const FiniteCloud finite = finite_cloud(raw);
  const double radius = options.number("radius");
  const auto begin = Clock::now();

  pcl::search::KdTree<pcl::PointXYZ>::Ptr tree(new pcl::search::KdTree<pcl::PointXYZ>);
  pcl::PointCloud<pcl::Normal>::Ptr normals(new pcl::PointCloud<pcl::Normal>);
  pcl::NormalEstimationOMP<pcl::PointXYZ, pcl::Normal> estimation(static_cast<unsigned>(options.number("threads")));
  estimation.setInputCloud(finite.cloud);
  estimation.setSearchMethod(tree);
  estimation.setViewPoint(finite.viewpoint[0], finite.viewpoint[1], finite.viewpoint[2]);
  estimation.setRadiusSearch(options.number("normal_radius"));
  estimation.compute(*normals);

  pcl::BoundaryEstimation<pcl::PointXYZ, pcl::Normal, pcl::Boundary> boundary;
  boundary.setInputCloud(finite.cloud);
  boundary.setInputNormals(normals);
  boundary.setSearchMethod(tree);
  boundary.setRadiusSearch(radius);
  boundary.setAngleThreshold(static_cast<float>(options.number("angle")));
  pcl::PointCloud<pcl::Boundary> found;
  boundary.compute(found);

  print_seconds(begin);
  std::vector<std::uint8_t> flags(static_cast<std::size_t>(raw.count), 0);
  for (std::size_t i = 0; i < finite.rows.size(); ++i) flags[finite.rows[i]] = found[i].boundary_point == 1;
  write_raw(out, flags);
}

int main(int argc, char** argv) { return guarded(argc, argv, detect); }
