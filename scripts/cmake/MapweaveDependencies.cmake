# Third parties, found once. Every one of them is a Debian 12 package (scripts/packages.txt).
foreach(module math poses obs maps io serialization img slam)
  find_package(mrpt-${module} REQUIRED)
endforeach()
find_package(Eigen3 REQUIRED NO_MODULE)
find_package(OpenCV 4.6 REQUIRED COMPONENTS core imgproc imgcodecs)
find_package(Ceres REQUIRED)
find_package(yaml-cpp REQUIRED)
find_package(spdlog REQUIRED)
find_package(CLI11 REQUIRED)
find_package(nlohmann_json REQUIRED)
find_package(Protobuf REQUIRED)
find_package(OpenSSL REQUIRED COMPONENTS Crypto)
find_package(SQLite3 REQUIRED)
find_package(ZLIB REQUIRED)
find_package(Threads REQUIRED)
find_package(PkgConfig REQUIRED)
pkg_check_modules(ZSTD REQUIRED IMPORTED_TARGET libzstd)
pkg_check_modules(IPOPT REQUIRED IMPORTED_TARGET ipopt)
find_package(GTest REQUIRED)

# PCL by its plain libraries: its CMake package would add VTK and Qt to every link line.
add_library(mapweave_pcl INTERFACE)
target_include_directories(mapweave_pcl SYSTEM INTERFACE /usr/include/pcl-1.13 /usr/include/eigen3)
target_link_libraries(mapweave_pcl INTERFACE pcl_common pcl_kdtree pcl_search pcl_registration)

add_library(mapweave_ipopt INTERFACE)
target_compile_definitions(mapweave_ipopt INTERFACE HAVE_CSTDDEF)   # Debian's 3.11.9 needs it
target_link_libraries(mapweave_ipopt INTERFACE PkgConfig::IPOPT)

add_library(mapweave_opencv INTERFACE)
target_include_directories(mapweave_opencv SYSTEM INTERFACE ${OpenCV_INCLUDE_DIRS})
target_link_libraries(mapweave_opencv INTERFACE opencv_core opencv_imgproc opencv_imgcodecs)
