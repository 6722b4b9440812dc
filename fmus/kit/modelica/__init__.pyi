from .names import PACKAGE as PACKAGE
from .names import class_name as class_name
from .package import package_files as package_files
