#!/bin/sh
# Makes .venv with ELYS and all it needs. Run by `make setup`; does nothing when that is done already.
set -eu
cd "$(dirname "$0")"

say() { printf '%s\n' "$*" >&2; }

# apt where it may, else one line to copy.
install_packages() {
    if [ "$(id -u)" = 0 ] && command -v apt-get >/dev/null; then
        as_root=""
    elif command -v sudo >/dev/null && command -v apt-get >/dev/null && sudo -n true 2>/dev/null; then
        as_root="sudo"
    else
        return 1
    fi
    say "Installing $* with apt ..."
    $as_root env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq "$@" >/dev/null 2>&1 || {
        $as_root apt-get update -qq >/dev/null 2>&1 || true
        $as_root env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq "$@" >/dev/null
    }
}

find_python() {
    for candidate in ${PYTHON:-} python3 python3.13 python3.12 python3.11; do
        if "$candidate" -c 'import sys; sys.exit(not (3, 11) <= sys.version_info < (3, 15))' 2>/dev/null; then
            printf '%s' "$candidate"
            return
        fi
    done
    say "ELYS needs Python 3.11 or newer. On Debian or Ubuntu:  sudo apt install python3 python3-venv"
    exit 1
}

python=$(find_python)
if ! "$python" -c 'import ensurepip, venv' 2>/dev/null; then
    version=$("$python" -c 'import sys; print(f"python3.{sys.version_info[1]}-venv")')
    install_packages "$version" || install_packages python3-venv || {
        say "Python's venv module is missing. Install it and call make again:  sudo apt install $version"
        exit 1
    }
fi
if [ ! -x .venv/bin/python ] || ! .venv/bin/python -c '' 2>/dev/null; then
    say "Making .venv with $("$python" --version) ..."
    rm -rf .venv
    "$python" -m venv .venv
fi
say "Installing ELYS and what it needs into .venv (a minute or two, once) ..."
.venv/bin/python -m pip install --quiet --disable-pip-version-check -e '.[all,dev]' 2>.venv/pip.log || {
    cat .venv/pip.log >&2
    say "pip could not install ELYS: the lines above say why."
    exit 1
}

# Drawing needs the system's OpenGL; simulating, recording and replaying do not.
libraries="libegl1 libgl1 libgl1-mesa-dri libgles2"
have_gl() {
    .venv/bin/python - <<'PY'
import ctypes, sys
try:
    for name in ("libEGL.so.1", "libGL.so.1"):
        ctypes.CDLL(name)
    import moderngl
    moderngl.create_context(standalone=True, backend="egl", require=330).release()
except Exception:
    sys.exit(1)
PY
}
if ! have_gl; then
    install_packages $libraries || true
    have_gl || say "OpenGL is missing, so nothing can be drawn yet. Install it:  sudo apt install $libraries"
fi

# The page of `elys web` is tested in a real browser; nothing else needs one.
have_browser() { command -v chromium || command -v chromium-browser || command -v google-chrome; }
if ! have_browser >/dev/null; then
    install_packages chromium || true
    have_browser >/dev/null || say "There is no Chromium: the tests of \`elys web\` are left out. Install it:  sudo apt install chromium"
fi
touch .venv/.ready
say "Ready. Try: make demo"
