#!/usr/bin/env bash
# Proves that marchless needs no standard library: the probe links and runs without it, and does not compile as soon
# as marchless's feature `std` brings it in (otherwise the probe would prove nothing).
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")"
target="$(realpath -m "${CARGO_TARGET_DIR:-../../target}")/no_std_probe"

cargo run --quiet --locked --target-dir "$target"
echo "no_std: the probe links without std, and meshes a ball"

if output="$(cargo build --quiet --locked --features std --target-dir "$target" 2>&1)"; then
    echo "error: the probe builds with std switched on: it would not notice a leak of std" >&2
    exit 1
fi
if ! grep -q 'E0152.*duplicate lang item.*panic_impl' <<<"$output"; then
    echo "error: with std switched on, the build should fail with E0152 (duplicate lang item panic_impl), but said:" >&2
    echo "$output" >&2
    exit 1
fi
echo "no_std: with std switched on, the probe fails as it should (E0152, duplicate lang item)"
