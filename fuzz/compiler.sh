#!/bin/sh
# rustc for `make fuzz` (RUSTC_WRAPPER): coverage for what fuzz/Cargo.toml optimizes fully, which is what reads files, and for
# nothing else. The passes are those of cargo-fuzz, and any rustc has them. Programs that run while building have no --target.
case " $* " in
*" opt-level=3 "*" --target "*)
    exec "$@" -Cpasses=sancov-module -Cllvm-args=-sanitizer-coverage-level=4 -Cllvm-args=-sanitizer-coverage-inline-8bit-counters \
        -Cllvm-args=-sanitizer-coverage-pc-table -Cllvm-args=-sanitizer-coverage-trace-compares \
        -Cllvm-args=-simplifycfg-branch-fold-threshold=0 --cfg fuzzing
    ;;
esac
exec "$@"
