# find_package(selfcal) gives the target selfcal::client.
include(CMakeFindDependencyMacro)
find_dependency(Eigen3 3.4)
find_dependency(absl)
include(${CMAKE_CURRENT_LIST_DIR}/selfcalTargets.cmake)
