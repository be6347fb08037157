#!/usr/bin/env bash
# ONNX Runtime: whether a NaN decides ArgMax and ReduceMax depends on where in the row it stands.
#
# One would guess: a NaN among the values of a network is either always kept (NumPy and PyTorch: the maximum is NaN, and argmax
# points at it) or always passed over, and one runtime does the same in all operators that look for a largest value.
#
# What happens on the CPU: a NaN in the first place is the answer of ArgMax, ReduceMax and ReduceMin; in any other place these three
# pass it over and answer as if it were not there. Max, Clip, TopK and Relu of the same runtime keep it wherever it stands, and so
# does the reference evaluator of the package onnx, for each of them.
#
# Seen with onnxruntime 1.32.0 and onnx 1.23.2 from PyPI, Python 3.11, Linux x86_64:
#     NaN in place 0: ArgMax 0 (reference 0), ReduceMax nan (reference nan), TopK 0
#     NaN in place 1: ArgMax 2 (reference 1), ReduceMax 3.0 (reference nan), TopK 1
#     NaN in place 2: ArgMax 1 (reference 2), ReduceMax 2.0 (reference nan), TopK 2
#
# Why it matters: a policy is exported with its argmax inside the graph, since that is what the vehicle needs. One broken Q-value is
# then noticed, or hidden behind an ordinary action, by the accident of which action it belongs to; a test with the NaN in front
# finds nothing wrong. Export the values, and look for NaN outside of the graph.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
python3 -m venv "$work/venv"
"$work/venv/bin/pip" install --quiet --disable-pip-version-check onnx==1.23.2 onnxruntime==1.32.0
"$work/venv/bin/python" - <<'PY'
import warnings

import numpy as np
import onnx
import onnxruntime
from onnx import TensorProto, helper, numpy_helper
from onnx.reference import ReferenceEvaluator

warnings.simplefilter("ignore")
ROW = (1.0, 2.0, 3.0)

nodes = [
    helper.make_node("ArgMax", ["row"], ["argmax"], axis=1, keepdims=0),
    helper.make_node("ReduceMax", ["row"], ["largest"], keepdims=0),
    helper.make_node("TopK", ["row", "count"], ["top", "top_place"]),
]
outputs = [
    helper.make_tensor_value_info("argmax", TensorProto.INT64, [1]),
    helper.make_tensor_value_info("largest", TensorProto.FLOAT, []),
    helper.make_tensor_value_info("top_place", TensorProto.INT64, [1, 1]),
]
graph = helper.make_graph(
    nodes,
    "largest_values",
    [helper.make_tensor_value_info("row", TensorProto.FLOAT, [1, len(ROW)])],
    outputs,
    [numpy_helper.from_array(np.array([1], np.int64), "count")],
)
model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 20)], ir_version=10)
onnx.checker.check_model(model, full_check=True)
runtime = onnxruntime.InferenceSession(model.SerializeToString(), providers=["CPUExecutionProvider"])
reference = ReferenceEvaluator(model)

for place in range(len(ROW)):
    row = np.array([ROW], np.float32)
    row[0, place] = np.nan
    argmax, largest, top = (float(np.squeeze(value)) for value in runtime.run(None, {"row": row}))
    argmax0, largest0, _ = (float(np.squeeze(value)) for value in reference.run(None, {"row": row}))
    print(
        f"NaN in place {place}: ArgMax {argmax:.0f} (reference {argmax0:.0f}), "
        f"ReduceMax {largest} (reference {largest0}), TopK {top:.0f}"
    )
    assert argmax0 == place and np.isnan(largest0), "the reference no longer keeps NaN"
    assert top == place, "TopK no longer takes NaN for the largest value"
    seen = argmax == place, bool(np.isnan(largest))
    assert seen == (place == 0, place == 0), "ArgMax and ReduceMax treat NaN another way now"
PY
