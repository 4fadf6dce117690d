"""What judges `stiction_ros`: worlds of known truth, benchmarks, studies, faults, the paper's figures."""
