//! Clients of the three kinds of servers, set up from the environment.

use crate::url::{BucketUrl, Provider};
use object_store::{
    ObjectStore, Result, RetryConfig, aws::AmazonS3Builder, azure::MicrosoftAzureBuilder,
    gcp::GoogleCloudStorageBuilder,
};
use std::{sync::Arc, time::Duration};

/// The client of a bucket.
pub(crate) fn to(url: &BucketUrl) -> Result<Arc<dyn ObjectStore>> {
    let name = url.bucket();
    Ok(match url.provider() {
        Provider::S3 => Arc::new(AmazonS3Builder::from_env().with_bucket_name(name).with_retry(few_retries()).build()?),
        Provider::Google => {
            Arc::new(GoogleCloudStorageBuilder::from_env().with_bucket_name(name).with_retry(few_retries()).build()?)
        }
        Provider::Azure => {
            Arc::new(MicrosoftAzureBuilder::from_env().with_container_name(name).with_retry(few_retries()).build()?)
        }
    })
}

/// A bake makes in seconds what it does not find: it is not worth waiting long for.
pub(crate) fn few_retries() -> RetryConfig {
    RetryConfig { max_retries: 3, retry_timeout: Duration::from_secs(10), ..RetryConfig::default() }
}
