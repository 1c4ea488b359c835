"""What option_effect_test.py runs: small runs, and below each of them the options that it shows with the values they get.

A line of a case is `option value`, and behind a semicolon what else is set in both runs to make the option matter. A number is the
element of a list: robots.0.edge. Words in braces are inputs (option_effect_inputs.py).
"""
RUNS = {
    "lasers": ("slam", "{lasers}/alpha.rawlog"),
    "loops": ("slam", "{loops}/alpha.rawlog", "laser.graph.front_end.submap_length_m=3", "output.g2o=true"),
    "swept": ("slam", "{lasers}/alpha.rawlog", "laser.scan.sweep=given", "laser.scan.sweep_s=0.1"),
    "rbpf": ("slam", "{lasers}/alpha.rawlog", "laser.engine=rbpf"),
    "icp": ("slam", "{lasers}/alpha.rawlog", "laser.engine=icp"),
    "carmen": ("slam", "{written}/room.log"),
    "late": ("slam", "{written}/late.log"),
    "turning": ("slam", "{turning}/alpha.rawlog"),
    "doubtful": ("slam", "{alike}/alpha.rawlog", "laser.graph.front_end.submap_length_m=2", "laser.graph.loops.drift_per_m=0.3", "output.g2o=true"),
    "slip": ("slam", "{written}/slip.log"),
    "jump": ("slam", "{written}/jump.log"),
    "lost": ("slam", "{written}/lost.log"),
    "g2o": ("slam", "{written}/unstamped.g2o"),
    "folder": ("slam", "{folder}/alpha_camera", "sensor=rgbd"),
    "bag": ("slam", "{written}/robot.bag"),
    "bags": ("slam", "{written}/robots.bag", "reading.robot_namespace=alpha"),
    "rings": ("slam", "{written}/rings.bag"),
    "clouds": ("slam", "{written}/clouds.bag"),
    "team": ("run", "{lasers}/run.yaml"),
    "merged": ("merge", "{maps}/robots/alpha/map.mwdb", "{maps}/robots/beta/map.mwdb", "output.g2o=true"),
    "alike": ("merge", "{doubles}/robots/alpha/map.mwdb", "{doubles}/robots/beta/map.mwdb", "output.g2o=true"),
    "grids": ("merge", "{maps}/robots/alpha/map.yaml", "{maps}/robots/beta/map.yaml"),
    "camera": ("slam", "{cameras}/alpha.rawlog", "sensor=rgbd"),
    "ring": ("slam", "{ring}/alpha.rawlog", "sensor=rgbd"),
    "wheelless": ("slam", "{ring}/alpha_camera", "sensor=rgbd"),
    "stereo": ("slam", "{stereo}/alpha.rawlog", "sensor=stereo"),
    "mono": ("slam", "{mono}/alpha.rawlog", "sensor=mono"),
    "seen": ("merge", "{seen}/robots/alpha/map.mwdb", "{seen}/robots/beta/map.mwdb"),
    "sharing": ("run", "{cameras}/run.yaml", "sensor=rgbd", "server.share=full", "robots.0.edge=edge0", "robots.1.edge=edge0"),
    "both": ("run", "{cameras}/run.yaml", "sensor=all", "robots.0.edge=edge0", "robots.1.edge=edge0"),
    "rig": ("slam", "{rig}/alpha.rawlog", "sensor=cameras"),
    "monocular": ("slam", "{monocular}/alpha.rawlog", "sensor=mono"),
    "dense": ("slam", "{cameras}/alpha.rawlog", "sensor=rgbd", "output.ply=true", "output.octomap=true"),
    "coordinated": ("run", "{lasers}/run.yaml", "coordinator.method=recslam", "coordinator.overlap_period_s=5",
                    "edges=[{id: north}, {id: south, speed: 0.7}]", "robots.0.edge=north", "robots.1.edge=north"),
    "timeline": ("timeline", "{maps}"),
}

# Those that take seconds, for a look at each build.
QUICK_RUNS = ("timeline", "carmen", "late", "g2o", "slip", "jump", "lost", "swept", "folder", "bag", "bags", "rings", "clouds", "team")

CASES = {
    "lasers": """
sensor rgbd
laser.engine icp
laser.scan.label other
laser.scan.min_range_m 1
laser.scan.max_range_m 3
laser.scan.sweep none
laser.graph.front_end.min_range_m 1.5
laser.graph.front_end.max_range_m 3
laser.graph.front_end.thinning_m 0.3
laser.graph.front_end.most_points 40
laser.graph.front_end.window_yaw_rad 0.01
laser.graph.front_end.insert_distance_m 0.4
laser.graph.front_end.insert_yaw_rad 0.5
laser.graph.front_end.submap_length_m 3
laser.graph.front_end.submap_scans 15
laser.graph.front_end.odometry_sigma_m 0.2
laser.graph.front_end.odometry_sigma_per_m 0.01
laser.graph.front_end.odometry_sigma_yaw_rad 0.1
laser.graph.front_end.odometry_sigma_yaw_per_rad 0.01
laser.graph.front_end.point_information_scale 0.5
laser.graph.front_end.min_inliers 0.97
laser.graph.sweep.estimate false
laser.graph.sweep.delay_s 0.2; laser.graph.sweep.estimate=false
laser.graph.sweep.shortest_s 1
laser.graph.sweep.min_sigmas 100000
laser.graph.rematch.radius_m 0.3
laser.graph.rematch.most_submaps 1
laser.graph.rematch.min_inliers 0.99
laser.graph.rematch.max_correction_m 0.002
laser.graph.rematch.max_correction_rad 0.0005
laser.graph.rematch.information_scale 0.5
compose.resolution_m 0.1
compose.max_range_m 2
compose.hit_probability 0.9
compose.miss_probability 0.2
output.png false
output.pgm false
output.pcd false
output.tum false
output.g2o true
output.report false
output.picture.least_width_px 3000
output.picture.common_side_px 500
output.picture.most_side_px 500; compose.resolution_m=0.01
output.cloud.voxel_m 0.5
output.cloud.max_range_m 2
reading.max_object_mb 0.0001
""",
    "loops": """
laser.graph.loops.drift_per_m 0.5
laser.graph.loops.drift_yaw_per_submap_rad 0.3
laser.graph.loops.max_radius_m 0.05
laser.graph.loops.nearest 0
laser.graph.loops.alike 0; laser.graph.loops.nearest=0
laser.graph.loops.confirm_radius_m 0.01
laser.graph.loops.min_probability 1
laser.graph.loops.cache_mb 1
laser.graph.judge.min_score 0.95
laser.graph.judge.min_overlap_m2 60
laser.graph.judge.min_inliers 0.99
laser.graph.judge.min_observability 0.9
laser.graph.judge.second_verifier false; laser.graph.judge.min_verifier_inliers=0.99
laser.graph.judge.min_verifier_inliers 0.99
laser.graph.judge.max_verifier_disagreement_m 0.001
laser.graph.judge.search_budget 1000
laser.graph.solve.iterations 1
laser.graph.solve.truncation_chi2 0.01
laser.graph.solve.robust_rounds 1; laser.graph.solve.truncation_chi2=1
""",
    "turning": """
laser.scan.inertial none
laser.graph.front_end.inertial_sigma_yaw_rad 0.3
laser.graph.front_end.inertial_sigma_yaw_per_rad 0.9
pose.jump_m 0.000001
pose.jump_rad 0.000001
""",
    "doubtful": """
laser.graph.judge.rival_ratio 0.1; laser.graph.judge.max_second_best=0
laser.graph.judge.max_conflict 0
laser.graph.judge.max_contradiction_m 0.01
laser.graph.judge.max_second_best 0
""",
    "slip": """
laser.graph.front_end.window_m 0.05
""",
    "jump": """
laser.scan.max_speed_mps 0.5
""",
    "lost": """
laser.graph.front_end.lost_scans 2
""",
    "swept": """
laser.scan.sweep_s 0.2
laser.scan.sweep_order against_rays
laser.scan.sweep_stamp 1
""",
    "rbpf": """
seed 9
laser.rbpf.seed 9
laser.rbpf.particles 9
laser.rbpf.correct_odometry false
laser.rbpf.match_distance_m 0.5
laser.rbpf.match_yaw_rad 0.5
laser.rbpf.update_distance_m 1
laser.rbpf.update_yaw_rad 1
laser.rbpf.insert_distance_m 0.4
laser.rbpf.insert_yaw_rad 0.2
laser.rbpf.resample_below 1
laser.rbpf.weight_power 0.1; laser.rbpf.resample_below=1
laser.rbpf.point_distance_m 0.5
laser.rbpf.memory_limit_mb 200; laser.rbpf.particles=6 laser.rbpf.grid.ray_length_m=150
laser.rbpf.icp.iterations 2
laser.rbpf.icp.match_distance_m 0.06
laser.rbpf.icp.final_match_distance_m 0.3
laser.rbpf.icp.shrink 0.2
laser.rbpf.icp.point_decimation 1
laser.rbpf.grid.resolution_m 0.2
laser.rbpf.grid.ray_length_m 2
laser.rbpf.grid.certainty 0.9
laser.rbpf.grid.sigma_m 0.1
laser.rbpf.grid.match_distance_m 1
laser.rbpf.grid.ray_decimation 1
""",
    "icp": """
laser.icp.update_distance_m 0.5
laser.icp.update_yaw_rad 0.5
laser.icp.insert_distance_m 0.2
laser.icp.insert_yaw_rad 0.1
laser.icp.min_goodness 0.95
laser.icp.point_distance_m 0.5
laser.icp.icp.iterations 2
laser.icp.icp.match_distance_m 0.06
laser.icp.icp.final_match_distance_m 0.3
laser.icp.icp.shrink 0.2
laser.icp.icp.point_decimation 1
laser.external.helper /no/such/helper
laser.external.show_messages true
laser.external.submaps.scan_distance_m 0.5
laser.external.submaps.scan_yaw_rad 0.5
laser.external.submaps.min_returns 122
laser.external.submaps.submap_length_m 3
laser.external.submaps.scan_match.m_per_sqrt_m 0.2
laser.external.submaps.scan_match.rad_per_sqrt_m 0.03
laser.external.submaps.scan_match.rad_per_sqrt_rad 0.1
laser.external.submaps.odometry.m_per_sqrt_m 0.2
laser.external.submaps.odometry.rad_per_sqrt_m 0.1
laser.external.submaps.odometry.rad_per_sqrt_rad 0.3
""",
    "carmen": """
reading.laser_x_m 0.3
reading.laser_y_m 0.3
reading.laser_yaw_rad 0.3
reading.max_range_m 3
""",
    "late": "reading.reorder_window_s 0.1",
    "g2o": "reading.scan_rate_hz 5",
    "folder": "reading.max_pair_s 0",
    "bag": """
reading.topics [/scan]; reading.use_tf=false
reading.robot_frame laser
reading.use_tf false
""",
    "bags": "reading.robot_namespace beta",
    "rings": "reading.cloud_ring 2",
    "clouds": """
reading.cloud_low_m -0.3
reading.cloud_high_m 0.3
reading.point_clouds depth
""",
    "team": """
robots.0.id gamma
robots.0.log {written}/room.log
robots.0.edge edge1
robots.0.edges [edge0, edge1]; robots.0.edge=""
robots.0.start.x_m 3; robots.0.start.sigma_m=0.3 robots.1.start.sigma_m=0.3
robots.0.start.y_m 3; robots.0.start.sigma_m=0.3 robots.1.start.sigma_m=0.3
robots.0.start.yaw_rad 2; robots.0.start.sigma_m=0.3 robots.1.start.sigma_m=0.3
robots.0.start.sigma_m 0.5; robots.1.start.sigma_m=0.3
robots.0.start.sigma_rad 0.5; robots.0.start.sigma_m=0.3 robots.1.start.sigma_m=0.3
edges.0.id west; robots.0.edge="" robots.1.edge="" edges=[{id: north}]
edges.0.capacity 1; robots.0.edge="" robots.1.edge="" edges=[{id: north}]
edges.0.speed 0.5; edges=[{id: edge0},{id: edge1}]
cloud.at edge0; network.edge_cloud.delay_s=36000
cloud.push_to [alpha]
maps [{maps}/robots/alpha/map.mwdb]
cloud.edges_judge false
robots.0.laser {graph: {front_end: {submap_length_m: 3}}}
robots.0.reading {max_object_mb: 0.0001}
robots.0.pose {jump_m: 0.000001}
team.refuse ["alpha,beta"]
output.octomaps_of team; output.octomap=true
cloud.thin_maps false
cloud.thinning.cell_m 0.5
cloud.thinning.new_share 0.5
cloud.thinning.sightings 3
cloud.rounds.period_s 5
cloud.rounds.new_area_m2 20
cloud.rounds.pictures 1; cloud.rounds.period_s=5
mode cloud-only
team.frame beta
coordinator.method greedy
""",
    "merged": """
fusion.most_pairs 1
fusion.merge_probability 1
fusion.last_proposer ring-keys; fusion.merge_probability=1
fusion.cache_mb 1
fusion.judge.min_score 0.95
fusion.judge.min_overlap_m2 60
fusion.judge.min_inliers 0.99
fusion.judge.max_conflict 0
fusion.judge.max_contradiction_m 0.01
fusion.judge.min_verifier_inliers 0.99
fusion.judge.max_verifier_disagreement_m 0.001
fusion.judge.search_budget 1000
fusion.rematch.radius_m 0.3
fusion.rematch.most_submaps 1
fusion.rematch.min_inliers 0.99
fusion.rematch.max_correction_m 0.002
fusion.rematch.max_correction_rad 0.0005
fusion.rematch.information_scale 0.5
fusion.solve.iterations 1
fusion.solve.truncation_chi2 0.01
fusion.solve.robust_rounds 1; fusion.solve.truncation_chi2=0.1
""",
    "alike": """
fusion.candidates_per_submap 1
fusion.stride_m 0
fusion.max_rival 0; fusion.merge_probability=1
fusion.judge.rival_ratio 0.1
fusion.judge.max_second_best 0.1
fusion.judge.min_observability 0.9
fusion.judge.second_verifier false; fusion.judge.min_verifier_inliers=0.99
""",
    "grids": """
fusion.grids.proposals.scale_range 0
fusion.grids.proposals.scale_step 0.1
fusion.grids.proposals.rotations 1
fusion.grids.proposals.contradiction 5
fusion.grids.proposals.most 1
fusion.grids.mirrored 1
""",
    "camera": """
visual.label other
visual.tracking.sigma_px 2
visual.tracking.reach_px 2
visual.tracking.min_correlation 0.97
visual.tracking.cell_px 40
visual.tracking.near_keyframes 1
visual.tracking.least_landmarks 80
visual.tracking.gate_sigmas 1.5
visual.tracking.features 80
visual.keyframe.kept_share 0.95
visual.keyframe.turn_rad 0.05
visual.keyframe.parallax 0.02
visual.depth.inverse_depth_sigma 0.05
visual.depth.max_depth_m 2
visual.depth.min_depth_m 1.5
visual.window.keyframes 2
visual.window.fixed_keyframes 0
visual.window.steps 1
visual.window.learn_readout false
visual.window.learn_depth_offset false
visual.memory.keyframes 20
visual.memory.redundant_share 0.3
visual.memory.redundant_views 1
visual.memory.found_share 0.99
visual.session.patience_s 0.3
""",
    "ring": """
pose.silence_s 10
visual.vocabulary {words}
visual.loops.enabled false
visual.loops.agreeing_keyframes 1
visual.loops.least_probability 0.9999
visual.loops.drift 0.5; visual.loops.drift_m=0.0001
visual.loops.drift_m 0.0001
visual.loops.delay_s 5
visual.loops.wait false
visual.session.least_corners 2000
visual.session.odometry_drift 0.9
""",
    "wheelless": """
visual.session.carried_m_per_s 0.01
visual.session.alike_m 0
""",
    "stereo": """
visual.depth.max_disparity 0.03
""",
    "mono": "visual.session.await_place true",
    "seen": """
fusion.min_probability 1
fusion.consistency_m 0.0001
fusion.consistency_per_m 0.9; fusion.consistency_m=0.0001
fusion.consistency_yaw_rad 0.0001
fusion.min_witnesses 1000
fusion.sole_witness_probability 0; fusion.visual.most_pairs=1
fusion.visual.candidates 1
fusion.visual.most_pairs 3
fusion.visual.enough_witnesses 1
fusion.visual.covisible 0
fusion.visual.least_alike 0.9
fusion.visual.adjustments 0
fusion.visual.sigma_px 3
fusion.visual.inverse_depth_sigma 0.1
fusion.visual.judge.matching.max_distance 20
fusion.visual.judge.matching.ratio 0.5
fusion.visual.judge.matching.rotation_window_deg 5
fusion.visual.judge.alignment.iterations 1
fusion.visual.judge.alignment.confidence 0.1
fusion.visual.judge.alignment.refinements 1
fusion.visual.judge.alignment.seed 9
fusion.visual.judge.alignment.least_inliers 200
fusion.visual.judge.sigma_px 4
fusion.visual.judge.guided_radius_px 1
fusion.visual.judge.guided_max_distance 10
fusion.visual.judge.neighbours 0; fusion.visual.judge.matching.max_distance=18
fusion.visual.judge.min_inliers 300
fusion.visual.judge.min_found 0.9
fusion.visual.judge.max_conflict 0.001
fusion.visual.judge.max_second_best 0; fusion.visual.judge.matching.ratio=1 fusion.visual.judge.matching.max_distance=120
fusion.visual.judge.min_spread 0.9
""",
    "sharing": """
server.share none
server.share_rate_hz 5
server.fuse_after 2
server.fuse_share 0.9
server.fuse_idle_s 0.1; server.fuse_after=1000 server.fuse_share=9
server.fuse_delay_s 8
server.wait false
server.judged_pairs 12
server.far_m 1
server.correct_m 0.0001
server.most_bytes_per_s 200
server.keyframes 20; visual.memory.keyframes=20
visual.memory.shared_keyframes 5; server.share=global
server.across_edges false; robots.1.edge=edge1
server.index.cell_m 50
server.index.spatial true
server.retrieval.margin_px 200
server.retrieval.most_turn_rad 0.05
server.retrieval.most_range_ratio 1.01
server.retrieval.most 5
server.description.reach_px 0.5
server.description.sigma_px 5
server.description.sigma_m 0.5
server.description.most_views 1
uplink.most_bytes_per_s 500
uplink.least_features 20; uplink.most_bytes_per_s=500
""",
    "rig": """
rig.enabled false
rig.longest_gap_s 0.05
rig.least_common_s 100
rig.threshold_m 5; rig.threshold_rad=3
rig.threshold_rad 3; rig.threshold_m=5
rig.extrinsic_sigma_m 0.1
rig.extrinsic_sigma_rad 0.1
rig.acceleration_m_per_s2 9
rig.acceleration_rad_per_s2 9
rig.covisibility_sigma_m 0.1
rig.covisibility_sigma_per_m 0.3
rig.covisibility_sigma_rad 0.1
rig.least_shared 200
rig.wrong_m 0.0001; rig.wrong_share=0
rig.wrong_share 0; rig.wrong_m=0.0001
rig.wrong_rad 0.00001
rig.most_wrong 1; rig.wrong_m=0.0001 rig.wrong_share=0
rig.trajectory.longest_gap_s 0.05
rig.trajectory.hand_over_s 9
rig.trajectory.doubt_m 0.0001
rig.trajectory.doubt_rad 0.0001
rig.trajectory.odometry_s 0.01; rig.trajectory.doubt_m=0.0001
""",
    "monocular": """
pose.scale_path_m 0.5
rig.covisibility_sigma_scale 0.5
rig.wheels_share 0.5
""",
    "both": """
pose.first cameras
robots.0.sensor laser
robots.0.visual {tracking: {features: 80}}
fusion.max_wall_conflict 0; fusion.merge_probability=1
laser_camera_alignment.longest_gap_s 0.001
laser_camera_alignment.extrinsic_sigma_m 0.5
laser_camera_alignment.extrinsic_sigma_rad 0.5
laser_camera_alignment.covisibility_sigma_m 0.5
laser_camera_alignment.covisibility_sigma_per_m 0.5
laser_camera_alignment.covisibility_sigma_rad 0.5
laser_camera_alignment.least_shared 1000
""",
    "dense": """
output.ply false
output.octomap false
output.dense.every_frames 3
output.dense.step_px 8
output.dense.most_error_m 0.01
output.dense.cloud.voxel_m 0.2
output.dense.cloud.memory_mb 1
output.dense.octomap.resolution_m 0.3
output.dense.octomap.memory_mb 1
""",
    "coordinated": """
robots.1.from_s 6
robots.0.route.0.x_m 4; robots.0.route=[{x_m: 0, y_m: 0}, {x_m: 3, y_m: 0}] robots.1.route=[{x_m: 1, y_m: 0}, {x_m: 2, y_m: 0}]
robots.0.route.0.y_m 4; robots.0.route=[{x_m: 0, y_m: 0}, {x_m: 3, y_m: 0}] robots.1.route=[{x_m: 1, y_m: 0}, {x_m: 2, y_m: 0}]
edges.0.from_s 5
edges.0.until_s 8
coordinator.at north
coordinator.model {model}
coordinator.overlap_period_s 2
coordinator.hysteresis 1; edges=[{id: north, speed: 0.1}, {id: south, speed: 3}]
coordinator.route_range_m 1; robots.0.route=[{x_m: 0, y_m: 0}, {x_m: 3, y_m: 0}] robots.1.route=[{x_m: 1, y_m: 0}, {x_m: 2, y_m: 0}]
""",
    "timeline": """
network.robot_edge.profile 4g
network.robot_edge.bytes_per_s 1000
network.robot_edge.delay_s 3
network.robot_edge.jitter_s 3
network.robot_edge.loss 0.8; network.robot_edge.profile=wifi
network.robot_edge.trace {written}/trace.csv
network.robot_cloud.profile 4g
network.robot_cloud.bytes_per_s 1000
network.robot_cloud.delay_s 3
network.robot_cloud.jitter_s 3
network.robot_cloud.loss 0.8
network.robot_cloud.trace {written}/trace.csv
network.edge_cloud.profile 4g
network.edge_cloud.bytes_per_s 1000
network.edge_cloud.delay_s 3
network.edge_cloud.jitter_s 3
network.edge_cloud.loss 0.8; network.edge_cloud.profile=wifi
network.edge_cloud.trace {written}/trace.csv
network.links.0.from beta; network.links=[{from: alpha, to: edge0, delay_s: 3}]
network.links.0.to edge1; network.links=[{from: alpha, to: edge0, delay_s: 3}]
network.links.0.profile 4g; network.links=[{from: alpha, to: edge0}]
network.links.0.bytes_per_s 1000; network.links=[{from: alpha, to: edge0}]
network.links.0.delay_s 3; network.links=[{from: alpha, to: edge0}]
network.links.0.jitter_s 3; network.links=[{from: alpha, to: edge0}]
network.links.0.loss 0.8; network.links=[{from: alpha, to: edge0, profile: wifi}]
network.links.0.trace {written}/trace.csv; network.links=[{from: alpha, to: edge0}]
processors.robot_profile jetson-tx2
processors.robot 0.1
processors.edge_profile jetson-tx2
processors.edge 0.1
processors.cloud_profile jetson-tx2
processors.cloud 0.1
""",
}

# Options that must not change a result. Those that stand in a case as well are tried.
WITHOUT_EFFECT = {
    "edges.broker": "of programs that talk (serve), not of a run; serve_keys_test.py",
    "reading.follow": "of recordings that are still written; test/rawlog/ros_recorder_test.cpp",
    "live.broker": "of programs that talk (serve), not of a run; serve_test.py and test/runtime/live_team_test.cpp",
    "live.keys": "of programs that talk (serve), not of a run; serve_keys_test.py",
    "live.unprotected": "of programs that talk (serve), not of a run; serve_keys_test.py",
    "live.store": "of programs that talk (serve), not of a run; serve_test.py and test/runtime/live_team_test.cpp",
    "live.speed": "of programs that talk (serve), not of a run; serve_test.py and test/runtime/live_team_test.cpp",
    "live.preview_period_s": "of programs that talk (serve), not of a run; serve_test.py and test/runtime/live_team_test.cpp",
    "live.robot_buffer_kb": "of programs that talk (serve), not of a run; serve_test.py and test/runtime/live_team_test.cpp",
    "live.edge_queue_kb": "of programs that talk (serve), not of a run; serve_test.py and test/runtime/live_team_test.cpp",
    "live.patience_s": "of programs that talk (serve), not of a run; serve_test.py and test/runtime/live_team_test.cpp",
    "live.lost_after_s": "of programs that talk (serve), not of a run; test/runtime/live_coordinator_test.cpp",
    "live.page_host": "of programs that talk (serve), not of a run; serve_test.py and test/runtime/page_server_test.cpp",
    "live.page_port": "of programs that talk (serve), not of a run; serve_test.py and test/runtime/page_server_test.cpp",
    "live.wire.repeat_s": "of programs that talk (serve), not of a run; serve_test.py and test/runtime/live_team_test.cpp",
    "live.wire.window_kb": "of programs that talk (serve), not of a run; serve_test.py and test/runtime/live_team_test.cpp",
    "live.camera_map_server.handlers": "of programs that talk (serve), not of a run; test/runtime/live_map_server_test.cpp",
    "live.camera_map_server.merge_threads": "of programs that talk (serve), not of a run; test/runtime/live_map_server_test.cpp",
    "live.camera_map_server.merge_share": "of programs that talk (serve), not of a run; test/runtime/live_map_server_test.cpp",
    "live.camera_map_server.queue_kb": "of programs that talk (serve), not of a run; test/runtime/live_camera_test.cpp",
    "live.camera_map_server.answers_kb": "of programs that talk (serve), not of a run; test/runtime/live_map_server_test.cpp",
    "live.camera_map_server.journal_kb": "of programs that talk (serve), not of a run; test/runtime/live_map_server_test.cpp",
    "laser.graph.loops.cache_mb": "memory against time; what fell out of the cache is made again, the same",
    "fusion.cache_mb": "memory against time; what fell out of the cache is made again, the same",
    "server.index.cell_m": "time alone: whatever the cells, each landmark in them is projected",
    "server.index.spatial": "time alone: whatever the cells, each landmark in them is projected",
}
# Options whose effect takes more than a test may: time, or memory.
TOO_LARGE = {
    "visual.memory.frames": "its least value, 1000 frames, is more than these runs have; test/visual/feature_client_test.cpp bounds it at 60",
    "coordinator.recslam.search": "these runs have two robots, which no swap improves; test/scheduling/plan_test.cpp has thirty",
    "coordinator.recslam.kappa": "as coordinator.recslam.search; test/scheduling/grouping_test.cpp",
    "coordinator.recslam.tau": "as coordinator.recslam.search; test/scheduling/grouping_test.cpp",
    "robots.rig": "these runs have one camera a robot; the other sections of a robot alone show the same code",
    "laser.icp.memory_limit_mb": "its least value, 200 MB, holds the points of kilometres; mrpt_mapper says where it is reached",
}
