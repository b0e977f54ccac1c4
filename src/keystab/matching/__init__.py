"""When two detections are the same, and the keypoints that are left when each counts once."""
