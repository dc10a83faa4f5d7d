#!/bin/sh
# The browser tests drive Debian's chromium. Install it where that is allowed; else say what is left out.
set -u
command -v chromium >/dev/null 2>&1 && exit 0
if command -v apt-get >/dev/null 2>&1 && [ "$(id -u)" = 0 ]; then
    echo "installing chromium for the browser tests"
    apt-get update -qq && apt-get install -y -qq chromium >/dev/null && exit 0
fi
echo "chromium is missing and cannot be installed from here: the browser tests are left out (apt-get install chromium)"
[ "${CI:-}" = true ] && exit 1
exit 0
