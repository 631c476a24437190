"""From a checkpoint to a show: the ONNX graph, its gate, and the bundle."""
