"""A device with one camera, as JSON of selfcal.v1.Rig without its name."""

RIG = {
    "factory": {
        "imu": {
            "s_g": {"x": 1, "y": 1, "z": 1},
            "m_g": {},
            "s_a": {"x": 1, "y": 1, "z": 1},
            "m_a": {},
            "q_ai": {"w": 1},
        },
        "cameras": [
            {
                "q_ci": {"w": 1},
                "p_ci": {"x": 0.01},
                "f": {"x": 260, "y": 260},
                "c": {"x": 320, "y": 240},
                "distortion_model": "DISTORTION_MODEL_FOV",
                "distortion": [0.92],
                "width_px": 640,
                "height_px": 480,
            }
        ],
    },
    "imu_noise": {
        "gyro_noise_density": 1.7e-4,
        "accel_noise_density": 2e-3,
        "gyro_bias_random_walk": 2e-5,
        "accel_bias_random_walk": 3e-3,
    },
    "pixel_sigma_px": 0.8,
}
