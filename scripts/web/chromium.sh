# Sourced by the tests that need a browser, which define skip(): sets and exports CHROMIUM, or skips the test.

find_chromium() {
    local name
    for name in "${CHROMIUM:-}" chromium chromium-browser google-chrome chrome; do
        if [ -n "$name" ] && command -v "$name" >/dev/null 2>&1; then
            export CHROMIUM=$name
            return
        fi
    done
    skip "there is no Chromium; name it with CHROMIUM="
}
