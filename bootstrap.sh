#!/bin/sh
# bootstrap.sh VENV     makes a virtual environment, with what it needs from Debian: a C compiler, Python's headers and venv
# bootstrap.sh --tests  installs what some tests need: cross compilers and QEMU, for Cortex-M, RISC-V, AArch64 and ARMv7, and
#                       programs of others that speak Modbus, QEMU for a Linux kernel with hardware that is simulated, and
#                       a browser for the page, and Neovim for its set-up
# bootstrap.sh --node   installs Node.js and npm, for `make vsix`
# bootstrap.sh --editors  the same, Neovim and Emacs, for `make test-editors`
# bootstrap.sh --fuzz   installs clang, with which libFuzzer runs the fuzz targets
# bootstrap.sh --windows  installs a compiler for Windows, and Wine, which runs what it makes
# bootstrap.sh --packages  installs what makes and tries Debian packages
#
# Packages are installed through apt when this runs as root. Otherwise the first form says what to type, and the others what
# will be left out.
set -eu
python=${PYTHON:-python3}

# install PACKAGE...: false when it cannot be done here
install() {
    [ "$(id -u)" = 0 ] && command -v apt-get >/dev/null || return 1
    apt-get update -qq
    DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends "$@" >/dev/null
}

if [ "$1" = --tests ]; then
    set --
    command -v arm-none-eabi-gcc >/dev/null || set -- "$@" gcc-arm-none-eabi picolibc-arm-none-eabi
    command -v qemu-system-arm >/dev/null || set -- "$@" qemu-system-arm
    command -v riscv64-unknown-elf-gcc >/dev/null || set -- "$@" gcc-riscv64-unknown-elf picolibc-riscv64-unknown-elf
    command -v qemu-system-riscv32 >/dev/null || set -- "$@" qemu-system-misc
    command -v aarch64-linux-gnu-gcc >/dev/null || set -- "$@" gcc-aarch64-linux-gnu libc6-dev-arm64-cross
    command -v arm-linux-gnueabihf-gcc >/dev/null || set -- "$@" gcc-arm-linux-gnueabihf libc6-dev-armhf-cross
    command -v qemu-aarch64 >/dev/null || set -- "$@" qemu-user
    command -v qemu-system-x86_64 >/dev/null || set -- "$@" qemu-system-x86
    command -v xz >/dev/null || set -- "$@" xz-utils
    command -v mbpoll >/dev/null || set -- "$@" mbpoll
    command -v chromium >/dev/null || set -- "$@" chromium
    command -v chromedriver >/dev/null || set -- "$@" chromium-driver
    command -v nvim >/dev/null || set -- "$@" neovim
    ls /usr/lib/*/libmodbus.so.5 >/dev/null 2>&1 || set -- "$@" libmodbus5
    [ $# = 0 ] || install "$@" || echo "Some tests are left out; for them: sudo apt-get install $*" >&2
    exit 0
fi

if [ "$1" = --editors ] || [ "$1" = --node ]; then
    editors=$1
    set --
    command -v node >/dev/null || set -- "$@" nodejs
    command -v npm >/dev/null || set -- "$@" npm
    [ "$editors" = --node ] || command -v nvim >/dev/null || set -- "$@" neovim
    [ "$editors" = --node ] || command -v emacs >/dev/null || set -- "$@" emacs-nox
    [ "$editors" = --node ] || ls -d /usr/share/emacs/site-lisp/elpa-src/dap-mode-* >/dev/null 2>&1 ||
        set -- "$@" elpa-dap-mode
    [ $# = 0 ] || install "$@" || {
        echo "Missing: $*. Install them, on Debian with: sudo apt-get install $*" >&2
        exit 1
    }
    exit 0
fi

if [ "$1" = --fuzz ]; then
    install clang libclang-rt-dev llvm ||
        echo "libFuzzer is left out; for it: sudo apt-get install clang libclang-rt-dev llvm" >&2
    exit 0
fi

if [ "$1" = --windows ]; then
    set --
    command -v x86_64-w64-mingw32-gcc-posix >/dev/null || set -- "$@" gcc-mingw-w64-x86-64-posix
    command -v wine >/dev/null || set -- "$@" wine wine64
    [ $# = 0 ] || install "$@" || {
        echo "Missing: $*. Install them, on Debian with: sudo apt-get install $*" >&2
        exit 1
    }
    exit 0
fi

if [ "$1" = --packages ]; then
    set --
    command -v dh >/dev/null || set -- "$@" debhelper dpkg-dev fakeroot
    command -v lintian >/dev/null || set -- "$@" lintian
    command -v debootstrap >/dev/null || set -- "$@" debootstrap
    [ $# = 0 ] || install "$@" || echo "Packages need: sudo apt-get install $*" >&2
    exit 0
fi

venv=$1
missing=
command -v cc >/dev/null || missing="$missing gcc libc6-dev"
if command -v "$python" >/dev/null; then
    "$python" -c 'import ensurepip, venv' 2>/dev/null || missing="$missing python3-venv"
    "$python" -c 'import os, sys, sysconfig; sys.exit(not os.path.exists(sysconfig.get_path("include") + "/Python.h"))' ||
        missing="$missing python3-dev"
else
    missing="$missing python3 python3-venv python3-dev"
fi
# shellcheck disable=SC2086 # a list of package names
if [ -n "$missing" ] && ! install $missing; then
    echo "Missing:$missing. Install them, on Debian with: sudo apt-get install$missing" >&2
    exit 1
fi

"$python" -c 'import sys; sys.exit(sys.version_info < (3, 11))' || {
    echo "Python 3.11 or newer is needed; $("$python" --version) found. Name another one with: make PYTHON=python3.11" >&2
    exit 1
}
[ -x "$venv/bin/python" ] || "$python" -m venv "$venv"
"$venv/bin/pip" install --quiet --upgrade pip
