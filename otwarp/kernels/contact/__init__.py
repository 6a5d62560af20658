"""Contact: who touches whom, and the forces that keep bodies apart.

detect finds touching pairs and detect_walls what touches obstacles, by obstacles, segments, curvature and excursion;
contact holds the law of one pair, response how far bodies give way to a force, contact_list what a world keeps of its
contacts; solve settles all contacts of a world in one direct solve, coupled_solve those of hydrodynamically coupled
bodies; body_solve settles soft ones for what they move the bodies, from gaps opened in open_gaps, by the laws of
implicit_law and the factors of blocks, point_solve for what they move one point of each, from what point_gather sums,
and few_solve a few for their forces; travel keeps fast bodies from passing through each other. Open solve first.
"""
