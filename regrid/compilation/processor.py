"""The processor for which numba compiles, and the width of its vectors.

Note: importing this file sets numba's features of the processor, for all of this process.
"""

from __future__ import annotations

import functools

import llvmlite.binding
import numba

# the first processors with vectors of 512 bits, which slow down where these are used
SLOW_AT_512 = ("skylake-avx512", "cascadelake", "cooperlake", "cannonlake")


def find_features() -> str:
    """What the processor can do, as LLVM writes it, without what NUMBA_ENABLE_AVX forbids."""
    try:
        features = llvmlite.binding.get_host_cpu_features()
    except RuntimeError:  # LLVM does not know this processor
        return ""
    for name in features:
        features[name] &= numba.config.ENABLE_AVX or not name.startswith("avx")
    return features.flatten()


def widen_vectors() -> None:
    """Let LLVM use vectors of 512 bits where the processor has them: by itself it stays at 256.

    Kernels are a tenth to a fifth faster, with the same bits.  It holds for all that numba compiles
    in this process.  NUMBA_CPU_NAME and NUMBA_CPU_FEATURES take precedence.
    """
    chosen = numba.config.CPU_NAME, numba.config.CPU_FEATURES
    if chosen != (None, None) or llvmlite.binding.get_host_cpu_name() in SLOW_AT_512:
        return
    features = find_features()
    if "+avx512f" in features.split(","):
        numba.config.CPU_FEATURES = f"{features},-prefer-256-bit"


widen_vectors()


@functools.cache
def find_machine() -> tuple[str, str, str]:
    """System, processor and its features, for which numba compiles."""
    processor = numba.config.CPU_NAME
    features = numba.config.CPU_FEATURES
    return (
        llvmlite.binding.get_process_triple(),
        llvmlite.binding.get_host_cpu_name() if processor is None else processor,
        find_features() if features is None else features,
    )
