# Third parties, found once. Every one of them is a Debian 12 package (scripts/packages.txt).
foreach(module math poses obs maps io serialization img slam)
  find_package(mrpt-${module} REQUIRED)
endforeach()
find_package(Eigen3 REQUIRED NO_MODULE)
find_package(Ceres REQUIRED)   # for tests: what ours is compared with
find_package(yaml-cpp REQUIRED)
find_package(spdlog REQUIRED)
find_package(CLI11 REQUIRED)
find_package(nlohmann_json REQUIRED)
find_package(Protobuf REQUIRED)
find_package(OpenSSL REQUIRED COMPONENTS Crypto)
find_package(SQLite3 REQUIRED)
find_package(ZLIB REQUIRED)
find_package(BZip2 REQUIRED)
find_package(JPEG REQUIRED)
find_package(Threads REQUIRED)
find_package(PkgConfig REQUIRED)
pkg_check_modules(ZSTD REQUIRED IMPORTED_TARGET libzstd)
pkg_check_modules(LZ4 REQUIRED IMPORTED_TARGET liblz4)
pkg_check_modules(IPOPT REQUIRED IMPORTED_TARGET ipopt)
pkg_check_modules(NATS REQUIRED IMPORTED_TARGET libnats)
pkg_check_modules(HTTPLIB REQUIRED IMPORTED_TARGET cpp-httplib)
find_package(octomap REQUIRED)
find_path(MAPWEAVE_METIS_INCLUDE metis.h)   # not required: a method of `plan` to compare with
find_package(GTest REQUIRED)

# PCL by its plain libraries: its CMake package would add VTK and Qt to every link line. Its headers: libpcl-dev's where it is
# installed, else those that the scripts unpacked from it (installing it brings VTK, Qt and a JDK, 1.4 GB; DECISIONS.md).
find_path(MAPWEAVE_PCL_INCLUDE pcl/registration/icp.h REQUIRED
  HINTS /usr/include/pcl-1.13 ${PROJECT_SOURCE_DIR}/build/packages/libpcl-dev/usr/include/pcl-1.13)
add_library(mapweave_pcl INTERFACE)
target_include_directories(mapweave_pcl SYSTEM INTERFACE ${MAPWEAVE_PCL_INCLUDE})
target_link_libraries(mapweave_pcl INTERFACE Eigen3::Eigen -l:libpcl_common.so.1.13 -l:libpcl_kdtree.so.1.13
  -l:libpcl_search.so.1.13 -l:libpcl_registration.so.1.13)

add_library(mapweave_ipopt INTERFACE)
target_compile_definitions(mapweave_ipopt INTERFACE HAVE_CSTDDEF)   # Debian's 3.11.9 needs it
target_link_libraries(mapweave_ipopt INTERFACE PkgConfig::IPOPT)

# OpenCV by its plain libraries too: its CMake package comes with libopencv-dev alone, which installs every module.
find_path(MAPWEAVE_OPENCV_INCLUDE opencv2/imgcodecs.hpp PATH_SUFFIXES opencv4 REQUIRED)
add_library(mapweave_opencv INTERFACE)
target_include_directories(mapweave_opencv SYSTEM INTERFACE ${MAPWEAVE_OPENCV_INCLUDE})
target_link_libraries(mapweave_opencv INTERFACE opencv_core opencv_imgproc opencv_imgcodecs)

# ROS 1 by the CMake package of roscpp and plain libraries: the packages of messages would load catkin. Their headers are in /usr/include.
set(MAPWEAVE_HAS_ROS FALSE)
if(NOT MAPWEAVE_ROS MATCHES "^(AUTO|OFF|FALSE|NO|0)$")
  set(ros_wanted TRUE)
endif()
if(ros_wanted OR MAPWEAVE_ROS STREQUAL "AUTO")
  find_package(roscpp QUIET)
  foreach(header nav_msgs/OccupancyGrid.h sensor_msgs/LaserScan.h tf2_ros/buffer.h visualization_msgs/MarkerArray.h diagnostic_msgs/DiagnosticArray.h
      map_msgs/OccupancyGridUpdate.h topic_tools/shape_shifter.h std_srvs/Trigger.h)
    cmake_path(GET header PARENT_PATH package)
    find_path(MAPWEAVE_${package}_INCLUDE ${header})
    mark_as_advanced(MAPWEAVE_${package}_INCLUDE)
    if(NOT MAPWEAVE_${package}_INCLUDE)
      string(REPLACE _ - package ${package})
      list(APPEND ros_missing lib${package}-dev)
    endif()
  endforeach()
  if(NOT roscpp_FOUND)
    list(PREPEND ros_missing libroscpp-dev)
  endif()
  if(NOT ros_missing)
    set(MAPWEAVE_HAS_ROS TRUE)
    add_library(mapweave_roscpp INTERFACE)
    target_include_directories(mapweave_roscpp SYSTEM INTERFACE ${roscpp_INCLUDE_DIRS})
    target_link_libraries(mapweave_roscpp INTERFACE tf2_ros tf2 topic_tools ${roscpp_LIBRARIES} boost_thread)
    message(STATUS "ROS 1: roscpp ${roscpp_VERSION}; its nodes are built")
  else()
    list(JOIN ros_missing " " ros_missing)
    if(ros_wanted)
      message(FATAL_ERROR "MAPWEAVE_ROS is ${MAPWEAVE_ROS}, and these packages are missing: ${ros_missing}. "
        "Install them (apt-get install --no-install-recommends ${ros_missing}), or configure with -DMAPWEAVE_ROS=AUTO to build without nodes of ROS")
    endif()
    message(STATUS "ROS 1: its nodes are not built; missing: ${ros_missing}")
  endif()
else()
  message(STATUS "ROS 1: its nodes are not built (MAPWEAVE_ROS is ${MAPWEAVE_ROS})")
endif()
