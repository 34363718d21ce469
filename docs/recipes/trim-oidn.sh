#!/bin/sh
# Removes the parts of the installed pyoidn wheel that `baker` never loads: code for graphics cards and programs.
# For Linux and images of containers. Run it after each installation of pyoidn:
#   sh trim-oidn.sh [PYTHON]
set -eu
folder=$("${1:-python3}" -c 'import pathlib, pyoidn; print(pathlib.Path(pyoidn.__file__).parent / "oidn")')
cd "$folder"
rm -rf bin/oidn* lib/cmake lib/libOpenImageDenoise_device_cuda* lib/libOpenImageDenoise_device_hip* \
    lib/libOpenImageDenoise_device_sycl* lib/libsycl* lib/libur_* lib/libumf*
