#!/usr/bin/env bash
# Build the messages of this folder into the environment of a Python interpreter: build.sh PYTHON
#
# PyPI has no polygon_msgs, but the generators that make message packages. They are installed into
# an environment of their own beside that one, because only the result is needed there.
set -euo pipefail
source=$(cd "$(dirname "$0")" && pwd)
python=$(realpath --no-symlinks "$1")
prefix=$(dirname "$(dirname "$python")")
tools=$prefix/message_tools
"$python" -m venv "$tools"
unset LD_LIBRARY_PATH PYTHONPATH _ROS_WHEELS_BOOTSTRAP_COMPLETE
"$tools/bin/pip" install --quiet cmake catkin_pkg numpy 'ros-rclpy[fastrtps]==7.1.6' \
    ros-jazzy-{rclpy,std-msgs,ament-package,ament-cmake,python-cmake-module} \
    ros-jazzy-ament-cmake-{include-directories,ros,gmock,gtest,pytest} \
    ros-jazzy-rosidl-{core,default}-generators
# The CMake files name the headers of the machine that built the wheels.
headers=$("$tools/bin/python" -c 'import sysconfig; print(sysconfig.get_path("include"))')
arrays=$("$tools/bin/python" -c 'import numpy; print(numpy.get_include())')
{ grep -rlE '/opt/python/' "$tools/share" --include='*.cmake' || true; } | xargs -r sed -i -E \
    -e "s#/opt/python/[^;\" ]*/numpy/[^;\" ]*include#$arrays#g" \
    -e "s#/opt/python/[^;\" ]*/include/python[0-9.]*#$headers#g"
export AMENT_PREFIX_PATH=$tools CMAKE_PREFIX_PATH=$tools PATH=$tools/bin:$PATH
cmake -S "$source" -B "$tools/build" -DCMAKE_INSTALL_PREFIX="$prefix" \
    -DPython3_EXECUTABLE="$tools/bin/python" -DBUILD_TESTING=OFF
cmake --build "$tools/build" --parallel 2
cmake --install "$tools/build"
rm -rf "$tools"
