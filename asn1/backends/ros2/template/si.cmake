cmake_minimum_required(VERSION 3.14)
project(captain_si NONE)

find_package(ament_cmake REQUIRED)
find_package(ament_cmake_python REQUIRED)

ament_python_install_package(${PROJECT_NAME})
ament_package()
