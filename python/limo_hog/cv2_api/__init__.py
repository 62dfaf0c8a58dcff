"""OpenCV's HOG detector in OpenCV's own words: names, arguments and return types of `cv2` 4.14."""
