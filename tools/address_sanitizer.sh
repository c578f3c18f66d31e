#!/usr/bin/env bash
# Runs the tests that reach all of the core's unsafe code with AddressSanitizer: a read or a write beyond a buffer ends
# them. Needs a nightly toolchain; skips without one.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

if ! rustup toolchain list 2>/dev/null | grep -q '^nightly-[a-z]'; then
    echo "skipped: AddressSanitizer needs a nightly toolchain"
    exit 0
fi
host="$(rustc +nightly --version --verbose | sed -n 's/^host: //p')"
target="$(realpath -m "${CARGO_TARGET_DIR:-target}")/address_sanitizer"

# Tests ask for more memory than there is, and want to be told.
export ASAN_OPTIONS="${ASAN_OPTIONS:+$ASAN_OPTIONS:}allocator_may_return_null=1"
# For a named target, flags leave build scripts and procedural macros alone.
sanitized() {
    RUSTFLAGS="-Zsanitizer=address" cargo +nightly test --quiet --locked --target "$host" --target-dir "$target" \
        --package marchless "$@"
}
sanitized --lib
modules=(backends oracle surface bits_ops bits_masks)
for module in "${modules[@]}"; do
    grep -qx "mod $module;" crates/marchless/tests/suite/main.rs
done
sanitized --test suite -- "${modules[@]/%/::}"
echo "AddressSanitizer: no read or write beyond a buffer"
