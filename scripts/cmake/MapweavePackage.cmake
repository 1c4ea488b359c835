# The Debian packages: scripts/package, or cpack -G DEB in a build folder. What they hold is said by install() beside it: mapweave, and the
# component ros, which is a package of its own: with it 38 more packages would be installed.
set(CPACK_PACKAGE_NAME mapweave)
set(CPACK_PACKAGE_VENDOR "The mapweave authors")
set(CPACK_PACKAGE_CONTACT "The mapweave authors <mapweave@localhost>")
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_COMPONENTS_ALL Unspecified)
if(MAPWEAVE_HAS_ROS)
  list(APPEND CPACK_COMPONENTS_ALL ros)
endif()
set(CPACK_PACKAGE_DESCRIPTION_SUMMARY "")   # descriptions begin with theirs
set(CPACK_DEBIAN_UNSPECIFIED_PACKAGE_NAME mapweave)
set(CPACK_DEBIAN_UNSPECIFIED_DESCRIPTION "${PROJECT_DESCRIPTION}
Maps what robots recorded with lasers and cameras, on the robots, on edge
servers or in one place, and merges their maps where they show the same place.
Units for systemd run robots, edges and a cloud as services, and map what
arrives in a folder.")
set(CPACK_DEBIAN_ROS_PACKAGE_NAME mapweave-ros)
set(CPACK_DEBIAN_ROS_DESCRIPTION "${PROJECT_DESCRIPTION}, over ROS 1
Nodes that record what robots publish, map it while they drive and publish
the maps, launch files for them, and the types of their services.")
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_STRIP_FILES ON)

set(CPACK_GENERATOR DEB)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_SECTION science)
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)
# The broker; what makes account and folders where there is systemd (else the package makes the account).
set(CPACK_DEBIAN_UNSPECIFIED_PACKAGE_RECOMMENDS "nats-server, systemd")
# The helper of some engines, and programs of one version alone talk to each other. What starts nodes and calls their services is in Python.
set(CPACK_DEBIAN_ROS_PACKAGE_DEPENDS "mapweave (= ${PROJECT_VERSION}), python3")
set(CPACK_DEBIAN_ROS_PACKAGE_RECOMMENDS "nats-server, python3-genpy, python3-roslaunch, python3-rosmaster, python3-rosservice")
set(CPACK_DEBIAN_ROS_PACKAGE_SUGGESTS "python3-rosmsg, rosbash, rviz")
set(CPACK_DEBIAN_PACKAGE_CONTROL_STRICT_PERMISSION TRUE)
set(CPACK_DEBIAN_UNSPECIFIED_PACKAGE_CONTROL_EXTRA ${PROJECT_SOURCE_DIR}/gui-less/debian/postinst
  ${PROJECT_SOURCE_DIR}/gui-less/debian/prerm ${PROJECT_SOURCE_DIR}/gui-less/debian/postrm)
include(CPack)

# Debian's own form of what changed, which leads to ours.
install(CODE "
  string(TIMESTAMP day \"%a, %d %b %Y %H:%M:%S +0000\" UTC)
  set(file \"\$ENV{DESTDIR}\${CMAKE_INSTALL_PREFIX}/share/doc/mapweave/changelog\")
  file(WRITE \"\${file}\" \"mapweave (${PROJECT_VERSION}) bookworm; urgency=medium\\n\\n  * See CHANGELOG.md beside this file.\\n\\n -- ${CPACK_PACKAGE_CONTACT}  \${day}\\n\")
  execute_process(COMMAND gzip -9nf \"\${file}\" COMMAND_ERROR_IS_FATAL ANY)")
if(MAPWEAVE_HAS_ROS)
  install(CODE "
    file(MAKE_DIRECTORY \"\$ENV{DESTDIR}\${CMAKE_INSTALL_PREFIX}/share/doc\")
    file(CREATE_LINK mapweave \"\$ENV{DESTDIR}\${CMAKE_INSTALL_PREFIX}/share/doc/mapweave-ros\" SYMBOLIC)" COMPONENT ros)
endif()
