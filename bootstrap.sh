#!/bin/sh
# Makes a virtual environment in $1. What Debian has to give (a C compiler, Python's headers and venv) is installed through
# apt when this runs as root; otherwise it says what to type.
set -eu
venv=$1
python=${PYTHON:-python3}

missing=
command -v cc >/dev/null || missing="$missing gcc libc6-dev"
command -v "$python" >/dev/null || missing="$missing python3"
if command -v "$python" >/dev/null; then
    "$python" -c 'import ensurepip, venv' 2>/dev/null || missing="$missing python3-venv"
    "$python" -c 'import os, sys, sysconfig; sys.exit(not os.path.exists(sysconfig.get_path("include") + "/Python.h"))' ||
        missing="$missing python3-dev"
else
    missing="$missing python3-venv python3-dev"
fi

if [ -n "$missing" ]; then
    if [ "$(id -u)" = 0 ] && command -v apt-get >/dev/null; then
        apt-get update -qq
        # shellcheck disable=SC2086 # a list of package names
        DEBIAN_FRONTEND=noninteractive apt-get install -y -qq $missing
    else
        echo "Missing:$missing. Install them, on Debian with: sudo apt-get install$missing" >&2
        exit 1
    fi
fi

"$python" -c 'import sys; sys.exit(sys.version_info < (3, 11))' || {
    echo "Python 3.11 or newer is needed; $("$python" --version) found. Name another one with: make PYTHON=python3.11" >&2
    exit 1
}
[ -x "$venv/bin/python" ] || "$python" -m venv "$venv"
"$venv/bin/pip" install --quiet --upgrade pip
