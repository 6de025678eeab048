"""How XLA compiles trainings and evaluations for NVIDIA GPUs.

A training is a loop of some hundred small kernels that one seed, or a few, do not fill a GPU with. As a rule the host
starts them, group by group, and each waits for the one before. Here whole loops are handed to the GPU as CUDA graphs,
and kernels of which none reads what the other writes run beside each other. The arithmetic is the same; what was seen
of the numbers' bits, and what it costs in memory, says docs/performance.md.
"""

import os
from functools import cache
from typing import Any

import jax
from jax.extend import backend

GRAPHS = {
    "xla_gpu_enable_command_buffer": "FUSION,CUBLAS,CUBLASLT,CUDNN,CUSTOM_CALL,CONDITIONAL,WHILE,DYNAMIC_SLICE_FUSION",
    "xla_gpu_graph_min_graph_size": 1,
    "xla_gpu_command_buffer_scheduling_mode": "CONCURRENT",
}
"""Options of XLA, by name."""

MPS = "CUDA_MPS_PIPE_DIRECTORY"
"""With this variable a process is a client of NVIDIA's multi-process service (MPS) that was set up for it. Four
trainings that shared a GPU so ended together with these options; why is not known, see docs/performance.md."""


def compiler_options() -> dict[str, Any]:
    """For `jax.jit`: `GRAPHS` on an NVIDIA GPU, without those that ``XLA_FLAGS`` names; nothing elsewhere, nor with
    `MPS`."""
    if jax.default_backend() != "gpu" or "cuda" not in backend.get_backend().platform_version.lower():
        return {}
    if MPS in os.environ:
        return {}
    flags = os.environ.get("XLA_FLAGS", "")
    return {name: value for name, value in GRAPHS.items() if f"--{name}=" not in flags and knows(name, value)}


@cache
def knows(name: str, value: Any) -> bool:
    """Whether this version of XLA has the option; a later one may have another."""
    try:
        jax.jit(lambda: 0, compiler_options={name: value}).lower().compile()
    except jax.errors.JaxRuntimeError:
        return False
    return True
