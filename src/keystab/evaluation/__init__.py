"""Statistics of keypoints, whatever detected them: stability, recall, precision, ROC curves."""
