"""Modules of torch: importing any of them imports torch, so others import them inside functions.

Open `network` first; floor plan, each file importing only from those above it:

    resnet, vgg, small         what turns an image into features: torchvision's networks, and a small one
    heads                      what turns features into classes, depth, and a pose with its covariance
    loss, augment              what is minimised; images that another camera might have taken
    network                    all of these as one module, from grey levels on
"""
