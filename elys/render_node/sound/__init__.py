"""What is heard of a scene: sounds at places, mixed for two ears where the camera stands.

SoundSource, sound events ──SoundStage──> voices ──Mixer──> 48 kHz stereo ──> a device (output.py) or a film (film_sound.py)
"""
