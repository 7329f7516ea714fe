"""gyriflow: from fetal brain MRI to cortical-folding metrics."""
