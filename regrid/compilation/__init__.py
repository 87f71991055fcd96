"""What is behind the decorators of `regrid.jit`: compiling kernels, and keeping them on the disk.

`contents` digests what a kernel consists of, `kept_files` reads and writes files that cannot be
damaged unnoticed, `first_calls` is what happens when Python calls a kernel for the first time.
Kernels come from the disk in one of two ways: `machine_code`, fast, by names that numba keeps to
itself, of releases where these are known; and `numba_cache`, by numba's public interface alone.
Imports nothing of `regrid`.
"""
